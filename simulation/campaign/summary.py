"""From the results of all scenarios to the numbers of each arm, and to the targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from simulation.campaign.statistics import Estimate, percentile, share
from simulation.scenarios.arrest import ALLOWED_DROP_M

HEAVY_KG: Final = (90.0, 110.0)  # 'a 100 kg person'


def summarise(results: Sequence[dict[str, Any]], arms: Sequence[str]) -> dict[str, Any]:
    """Return the summary of a campaign as plain values.

    `arms` holds the numbers of each arm; `families` the same for each family; `targets` what was to be reached.
    """
    families = sorted({(r["scenario"]["kind"], r["scenario"]["family"]) for r in results})
    return {
        "scenarios": len(results),
        "rejected_draws": sum(r["scenario"]["rejected_draws"] for r in results),
        "unassisted": _unassisted(results),
        "arms": {arm: arm_numbers(results, arm) for arm in arms},
        "families": {
            f"{kind}: {family}": {
                arm: _brief([r for r in results if r["scenario"]["family"] == family], arm, kind) for arm in arms
            }
            for kind, family in families
        },
        "targets": _targets(results, arms),
    }


def arm_numbers(results: Sequence[dict[str, Any]], arm: str) -> dict[str, Any]:
    """Return the numbers of one arm; what has an interval has it under `NAME_ci95`."""
    falls = _of_kind(results, arm, "fall")
    calm = _of_kind(results, arm, "non_fall")
    everything = [*falls, *calm]
    heavy = [
        r["trials"][arm]["measures"]
        for r in results
        if r["scenario"]["kind"] == "fall" and HEAVY_KG[0] <= r["scenario"]["person_mass_kg"] <= HEAVY_KG[1]
    ]
    arrested = sum(m["arrested_fall"] for m in falls)
    needless = sum(m["arrests"] > 0 for m in calm)
    numbers: dict[str, Any] = {
        "falls": len(falls),
        "falls_arrested": arrested,
        "non_falls": len(calm),
        "needless_arrests": needless,
        "needless_guards": sum(m["guards"] > 0 for m in calm),
        "non_falls_touched_floor": sum(m["touched"] for m in calm),
        "stops": sum(m["stops"] > 0 for m in everything),
        "tip_overs": sum(m["tipped"] for m in everything),
        "tilt_max_rad": max((m["tilt_rad"] for m in everything), default=float("nan")),
        "foreseen_before_descent": sum(m["foreseen_lead_s"] > 0 for m in falls),
        "stiff_before_descent": sum(m["lead_s"] > 0 for m in falls),
    }
    estimates: dict[str, Estimate] = {
        "falls_arrested_share": share(arrested, len(falls)),
        "needless_arrests_share": share(needless, len(calm)),
        "pelvis_drop_median_m": _percentile(falls, "pelvis_drop_m", 50),
        "pelvis_drop_p95_m": _percentile(falls, "pelvis_drop_m", 95),
        "pelvis_drop_p95_100_kg_m": _percentile(heavy, "pelvis_drop_m", 95),
        "peak_force_median_n": _percentile(falls, "peak_force_n", 50),
        "peak_force_p95_n": _percentile(falls, "peak_force_n", 95),
        "peak_force_median_weights": _percentile(falls, "peak_force_weights", 50),
        "peak_rate_median_n_s": _percentile(falls, "peak_rate_n_s", 50),
        "lead_median_s": _percentile(falls, "lead_s", 50),
        "unsteady_lead_median_s": _percentile(falls, "unsteady_lead_s", 50),
        "seen_lead_median_s": _percentile(falls, "seen_lead_s", 50),
        "foreseen_lead_median_s": _percentile(falls, "foreseen_lead_s", 50),
        "rms_force_median_n": _percentile(calm, "rms_force_n", 50),
        "energy_median_j_m": _percentile(calm, "energy_j_m", 50),
    }
    for name, estimate in estimates.items():
        numbers[name] = estimate.value
        numbers[f"{name}_ci95"] = [estimate.low, estimate.high]
    return numbers


def _of_kind(results: Sequence[dict[str, Any]], arm: str, kind: str) -> list[dict[str, Any]]:
    return [r["trials"][arm]["measures"] for r in results if r["scenario"]["kind"] == kind]


def _percentile(measures: Sequence[dict[str, Any]], name: str, which: float) -> Estimate:
    return percentile([m[name] for m in measures], which)


def _brief(results: Sequence[dict[str, Any]], arm: str, kind: str) -> dict[str, Any]:
    measures = [r["trials"][arm]["measures"] for r in results]
    numbers: dict[str, Any] = {"trials": len(measures)}
    if kind == "fall":
        numbers["arrested"] = sum(m["arrested_fall"] for m in measures)
        for name, key in (("pelvis_drop_median_m", "pelvis_drop_m"), ("peak_force_median_n", "peak_force_n")):
            numbers[name] = _percentile(measures, key, 50).value
    else:
        numbers["needless_arrests"] = sum(m["arrests"] > 0 for m in measures)
        numbers["needless_guards"] = sum(m["guards"] > 0 for m in measures)
        numbers["touched_floor"] = sum(m["touched"] for m in measures)
    return numbers


def _unassisted(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how the falls went when the harness was not worn: mean and standard deviation."""
    falls = [r["scenario"] for r in results if r["scenario"]["kind"] == "fall"]
    numbers: dict[str, Any] = {"falls": len(falls)}
    for key in ("unassisted_impact_s", "unassisted_descent_s", "unassisted_impact_speed_m_s"):
        values = [s[key] for s in falls if s[key] is not None and np.isfinite(s[key])]
        numbers[key.removeprefix("unassisted_")] = [float(np.mean(values)), float(np.std(values))] if values else None
    return numbers


def _targets(results: Sequence[dict[str, Any]], arms: Sequence[str]) -> list[dict[str, Any]]:
    if "anticipatory" not in arms or not results:
        return []
    best = arm_numbers(results, "anticipatory")
    rows = [
        ("falls arrested", best["falls_arrested_share"], ">= 0.95", lambda v: v >= 0.95),
        ("walker tip-overs", best["tip_overs"], "0", lambda v: v == 0),
        ("needless arrests", best["needless_arrests"], "0", lambda v: v == 0),
        ("pelvis drop, 95th percentile, 90 to 110 kg [m]", best["pelvis_drop_p95_100_kg_m"],
         f"<= {ALLOWED_DROP_M:.2f}", lambda v: v <= ALLOWED_DROP_M),
    ]  # fmt: skip
    if "reactive" in arms:
        base = arm_numbers(results, "reactive")["peak_force_median_n"]
        ratio = best["peak_force_median_n"] / base if base > 0 else float("nan")
        rows.append(("median peak force, of the reactive arm's", ratio, "<= 0.70", lambda v: v <= 0.70))
    return [_target(*row) for row in rows]


def _target(name: str, value: float, wanted: str, met: Callable[[float], bool]) -> dict[str, Any]:
    return {"name": name, "value": value, "target": wanted, "met": bool(met(value))}
