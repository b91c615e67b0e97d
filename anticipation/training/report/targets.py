"""What the project set itself, beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from anticipation.training.evaluation.scores import CONSTANT, SHIPPED, ZERO
from anticipation.training.report.tables import Table

_MISSING: Final = "not measured"
Reports = Mapping[str, Mapping[str, Any]]


def targets(reports: Reports) -> Table:
    """Set the targets beside what the protocols that were run found."""
    rows = [row for part in (_accuracy, _forecast, _system, _cross) for row in part(reports)]
    return Table(
        "Targets",
        ["", "target", "measured", ""],
        [
            [name, target, measured, "" if met is None else "met" if met else "missed"]
            for name, target, measured, met in rows
        ],
    )


_Row = tuple[str, str, str, bool | None]


def _accuracy(reports: Reports) -> list[_Row]:
    rows: list[_Row] = []
    for protocol, title, least in (
        ("grouped", "accuracy, URFD falls, by recording, 0 / 500 ms", (0.93, 0.88)),
        ("paper", "accuracy, the paper's random 80/20, 0 / 500 ms", (0.97, 0.95)),
    ):
        target = f"≥ {least[0]:.2f} / ≥ {least[1]:.2f}"
        values = _mean(reports, protocol)
        if values is None:
            rows.append((title, target, _MISSING, None))
            continue
        rows.append(
            (
                title,
                target,
                f"{values[0]:.3f} / {values[-1]:.3f}",
                bool(values[0] >= least[0] and values[-1] >= least[1]),
            )
        )
        if protocol == "grouped":
            lost = values[0] - values[-1]
            rows.append(("loss of accuracy from 0 to 500 ms", "≤ 0.04", f"{lost:.3f}", bool(lost <= 0.04)))
    return rows


def _mean(reports: Reports, protocol: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
    if protocol not in reports:
        return None
    parts = reports[protocol]["tables"]["urfd"]["accuracy"][SHIPPED]
    return np.asarray(np.nanmean(np.array(parts, dtype=np.float64), axis=0))


def _forecast(reports: Reports) -> list[_Row]:
    names = ("forecast error while falling over the best naive one, 300 / 500 ms", "the same at 100 ms")
    wanted = ("≤ 0.7 / ≤ 0.7", "≤ 1.0")
    if "grouped" not in reports:
        return [(name, target, _MISSING, None) for name, target in zip(names, wanted, strict=True)]
    report = reports["grouped"]
    errors = {
        name: np.nanmean(np.array(parts, dtype=np.float64), axis=0)
        for name, parts in report["forecast_error"]["falling_body"].items()
    }
    ratio = errors[SHIPPED] / np.minimum(errors[ZERO], errors[CONSTANT])
    near, middle, far = (float(ratio[report["error_horizons_ms"].index(ms)]) for ms in (100, 300, 500))
    return [
        (names[0], wanted[0], f"{middle:.2f} / {far:.2f}", max(middle, far) <= 0.7),
        (names[1], wanted[1], f"{near:.2f}", near <= 1.0),
    ]


def _system(reports: Reports) -> list[_Row]:
    report = reports.get("grouped", {})
    rows: list[_Row] = []
    if "events" in report:
        content = report["events"]["all"]
        share, median, fifth = (content[name] or 0.0 for name in ("share", "median_lead", "fifth_percentile_lead"))
        measured = f"{share:.0%}, {1000 * median:.0f} ms, {1000 * fifth:.0f} ms"
        met = share >= 0.95 and median >= 0.5 and fifth >= 0.25
        rows.append((_FORESEEN, _FORESEEN_TARGET, measured, met))
    else:
        rows.append((_FORESEEN, _FORESEEN_TARGET, _MISSING, None))
    if "daily" in report:
        clips = sum(each["clips"] for each in report["daily"])
        alarmed = sum(each["clips_with_any"] for each in report["daily"])
        rows.append(("clips of daily activities with an intervention", "0", f"{alarmed} of {clips}", alarmed == 0))
    else:
        rows.append(("clips of daily activities with an intervention", "0", _MISSING, None))
    shipped = next((each for each in report.get("transient", ()) if each["name"] == SHIPPED), None)
    if shipped is None or shipped["median"] is None:
        rows.append((_CORRELATION, "≥ 0.8", _MISSING, None))
    else:
        rows.append((_CORRELATION, "≥ 0.8", f"{shipped['median']:.2f}", shipped["median"] >= 0.8))
    return rows


_FORESEEN: Final = "falls foreseen before lying with no alarm before onset; median lead; 5th percentile"
_FORESEEN_TARGET: Final = "≥ 95 %, ≥ 500 ms, ≥ 250 ms"
_CORRELATION: Final = "Spearman of the distance to the fall boundary with time to impact, median fall"


def _cross(reports: Reports) -> list[_Row]:
    rows: list[_Row] = []
    for name, title in (("upfall", "UP-Fall"), ("urfd", "URFD")):
        label = f"macro-F1 drop on {title} if never learnt from, 0 / 500 ms"
        if not all(name in reports.get(protocol, {}).get("tables", {}) for protocol in ("grouped", "cross")):
            rows.append((label, "≤ 0.20", _MISSING, None))
            continue
        own, other = (reports[each]["tables"][name]["pooled"]["macro_f1"][SHIPPED] for each in ("grouped", "cross"))
        drops = [own[at] - other[at] for at in (0, -1)]
        rows.append((label, "≤ 0.20", f"{drops[0]:.3f} / {drops[1]:.3f}", max(drops) <= 0.20))
    return rows
