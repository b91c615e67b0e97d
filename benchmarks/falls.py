"""Reality checks of the simulated person: falls, survived pushes, gait and ground reaction force.

    python -m benchmarks.falls --json runs/bench/falls.json --figure runs/bench/falls.png

Falls: S. Choi et al., 'Kinematic analysis of video-captured falls experienced by older adults in long-term care',
J. Biomechanics 48(6), 2015: loss of balance to pelvis impact 1271 +- 648 ms, descent to impact 583 +- 255 ms, pelvis
speed at impact 2.14 +- 0.63 m/s. Survived pushes: `push_recovery/human-data.csv`, where the research data is. Gait:
D. Grieve and R. Gear, Ergonomics 9(5), 1966: step length grows with speed^0.42. Vertical force of a foot: T. Keller et
al., 'Relationship between vertical ground reaction force and speed during walking, slow jogging, and running', Clinical
Biomechanics 11(5), 1996: 1.2 body weights in walking at 1.5 m/s; in the two humps and the hollow of D. Winter,
'Biomechanics and Motor Control of Human Movement'. Forces are means over 20 ms.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.colours import FAINT, FALL, INK, STABLE
from simulation.person.ability import STURDY
from simulation.person.anthropometry import BodySize
from simulation.person.person import CONTROL_S, Intent
from simulation.scenarios.disturbance import Disturbance, Faint, Push, Slip, Trip
from simulation.scenarios.scenario import Performance, Scenario, Wish
from simulation.world.world import World

EVENT_S = 6.0
SMOOTH = round(0.020 / CONTROL_S)
LONGEST_S = 6.0  # after the event
CHOI = {"balance_to_impact_ms": (1271, 648), "descent_to_impact_ms": (583, 255), "impact_speed_m_s": (2.14, 0.63)}
SPEEDS = (0.3, 0.5, 0.7, 0.9, 1.1)
CHANGES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7)  # of velocity by a sideways push [m/s]
PUSHED_SPEED_M_S = 0.9  # as the 29 people walked, in the median
HUMPS = ((0.0, 0.35), (0.35, 0.65), (0.65, 1.0))  # of a stance: first hump, hollow, second hump
REST = (0.0, 0.0, 0.0, 0.0)


class Fall(NamedTuple):
    """A fall that ended with the pelvis or the trunk on the floor."""

    kind: str
    balance_to_impact_ms: float  # from the beginning of the disturbance
    descent_to_impact_ms: float  # from the last moment the pelvis was within 5 cm of its height
    impact_speed_m_s: float


def perform(disturbance: Disturbance, size: BodySize, speed: float) -> tuple[Fall | None, float]:
    """Return the fall, if there was one, and the largest sideways detour of a survived one [m]."""
    wishes = (Wish(1.0, Intent(speed)),)
    scenario = Scenario("fall", "fall", "x", size, wishes, STURDY, disturbances=(disturbance,))
    performance = Performance(scenario, worn=False)
    world = performance.world
    heights: list[float] = []
    detour, line, fastest = 0.0, 0.0, 0.0
    while world.time_s < EVENT_S + LONGEST_S:
        performance.advance(REST)
        height = float(world.pelvis_m[2])
        heights.append(height)
        if world.time_s < EVENT_S:
            line = float(world.pelvis_m[1])
            continue
        detour = max(detour, abs(float(world.pelvis_m[1]) - line))
        fastest = max(fastest, -float(world.pelvis_velocity_m_s[2]))
        if world.touched_down() in ("pelvis", "torso", "head") or height < 0.30:
            standing = float(np.mean(heights[round((EVENT_S - 1.0) / CONTROL_S) : round(EVENT_S / CONTROL_S)]))
            high = np.flatnonzero(np.array(heights) > standing - 0.05)
            descent = (len(heights) - 1 - int(high[-1])) * CONTROL_S
            return Fall(type(disturbance).__name__, (world.time_s - EVENT_S) * 1e3, descent * 1e3, fastest), detour
    return None, detour


def draw_people(rng: np.random.Generator, count: int) -> list[tuple[Disturbance, BodySize, float]]:
    """Return disturbances that exceed balance, on people of many sizes."""
    drawn: list[tuple[Disturbance, BodySize, float]] = []
    for index in range(count):
        size = BodySize(float(rng.uniform(1.5, 1.95)), float(rng.uniform(48, 110)))
        speed = float(rng.uniform(0.4, 0.9))
        at_s = EVENT_S + float(rng.uniform(0.0, 0.6))
        kinds: list[Disturbance] = [
            Push(at_s, float(rng.uniform(0.6, 1.3)) * size.mass_kg, float(rng.uniform(0, 360))),
            Trip(at_s, hold_s=float(rng.uniform(0.3, 0.6))),
            Slip(at_s),
            Faint(at_s),
        ]
        drawn.append((kinds[index % len(kinds)], size, speed))
    return drawn


def gait(speed: float, seconds: float = 24.0) -> dict[str, Any]:
    """Return cadence and step length of steady walking, and one foot's vertical force over a stance [body weight]."""
    size = BodySize(1.70, 75)
    world = World(size, STURDY, worn=False)
    while world.time_s < 8.0:
        world.advance(REST, Intent(speed if world.time_s > 1.0 else 0.0))
    steps, start = world.person.steps, world.pelvis_m.copy()
    force: list[float] = []
    while world.time_s < seconds:
        world.advance(REST, Intent(speed))
        force.append(vertical_force(world, "l") / (size.mass_kg * 9.81))
    way = float(np.linalg.norm(world.pelvis_m[:2] - start[:2]))
    count = world.person.steps - steps
    real = way / (seconds - 8.0)
    length = published_step(real, size.height_m)
    stance = stance_shape(np.convolve(force, np.ones(SMOOTH) / SMOOTH, "valid"))
    return {
        "wanted_m_s": speed, "speed_m_s": real, "cadence_steps_min": count / (seconds - 8.0) * 60.0,
        "step_length_m": way / max(count, 1), "published_step_length_m": length,
        "published_cadence_steps_min": 60.0 * real / length, "stance": stance, "humps_weights": humps(stance),
    }  # fmt: skip


def published_step(speed: float, height: float) -> float:
    """Return the step length at a speed after Grieve and Gear [m]."""
    return 0.62 * height / 1.70 * (speed / 1.2) ** 0.42


def humps(stance: list[float]) -> list[float]:
    """Return the highest, the lowest and again the highest force of a mean stance [body weight]."""
    if not stance:
        return []
    parts = [stance[round(100 * begin) : round(100 * end) + 1] for begin, end in HUMPS]
    return [max(parts[0]), min(parts[1]), max(parts[2])]


def vertical_force(world: World, side: str) -> float:
    """Return the vertical force under one sole [N]."""
    data, sole = world.data, world.person.sole[side]
    total = 0.0
    for contact in data.contact:
        if sole in (contact.geom1, contact.geom2) and contact.efc_address >= 0:
            rows = 2 * (contact.dim - 1)  # edges of the friction pyramid
            total += float(data.efc_force[contact.efc_address : contact.efc_address + rows].sum())
    return total


def stance_shape(force: np.ndarray) -> list[float]:
    """Return the mean force over a stance at 101 moments."""
    loaded = force > 0.05
    edges = np.flatnonzero(np.diff(loaded.astype(int)))
    shapes = [
        np.interp(np.linspace(0, 1, 101), np.linspace(0, 1, end - begin), force[begin:end])
        for begin, end in zip(edges[:-1] + 1, edges[1:] + 1, strict=True)
        if loaded[begin] and end - begin > 0.3 / CONTROL_S
    ]
    return np.mean(shapes, axis=0).tolist() if shapes else []


def recorded_detours() -> list[tuple[float, float]]:
    """Return (velocity change [m/s], detour [m]) of real people, or [] without the research data."""
    path = Path(os.environ.get("SUREFOOT_DATA", "../shared/data")) / "push_recovery" / "human-data.csv"
    if not path.is_file():
        return []
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    detour = "maximal_detour_distance"
    pairs = []
    for row in rows:
        try:
            pairs.append((float(row["push_force_normalized"]) / 1000.0, float(row[detour]) / 1000.0))
        except (KeyError, ValueError):
            continue
    return pairs


def summary(values: Sequence[float]) -> dict[str, float]:
    """Return mean and standard deviation."""
    return {"mean": float(np.mean(values)), "sd": float(np.std(values))}


def measure(count: int, seed: int) -> dict[str, Any]:
    """Run everything."""
    rng = np.random.default_rng(seed)
    falls = [fall for fall, _ in (perform(*each) for each in draw_people(rng, count)) if fall is not None]
    survived = []
    size = BodySize(1.75, 72)
    for change in CHANGES:
        for direction in (90.0, -90.0):
            for later in (0.0, 0.28, 0.55):
                push = Push(EVENT_S + later, change * size.mass_kg, direction)
                fall, detour = perform(push, size, PUSHED_SPEED_M_S)
                survived.append({"velocity_change_m_s": change, "detour_m": detour, "fell": fall is not None})
    kinds = sorted({fall.kind for fall in falls})
    return {
        "drawn": count,
        "fell": len(falls),
        "falls": {name: summary([getattr(fall, name) for fall in falls]) for name in CHOI},
        "by_kind": {
            kind: {name: summary([getattr(f, name) for f in falls if f.kind == kind]) for name in CHOI}
            for kind in kinds
        },
        "published": {name: {"mean": mean, "sd": sd} for name, (mean, sd) in CHOI.items()},
        "each": [fall._asdict() for fall in falls],
        "pushes": survived,
        "pushes_by_change": by_change(survived),
        "gait": [gait(speed) for speed in SPEEDS],
    }


def by_change(pushes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return, for each change of velocity, how many were survived and how far they led astray, beside real people."""
    recorded = recorded_detours()
    rows = []
    for change in CHANGES:
        own = [p for p in pushes if p["velocity_change_m_s"] == change]
        stood = [p["detour_m"] for p in own if not p["fell"]]
        real = [detour for c, detour in recorded if abs(c - change) <= 0.05]
        rows.append({
            "velocity_change_m_s": change, "survived": len(stood), "of": len(own),
            "detour_m": summary(stood) if stood else None, "recorded": len(real),
            "recorded_detour_m": summary(real) if real else None,
        })  # fmt: skip
    return rows


def draw(result: dict[str, Any], out: Path) -> None:
    """Write the figure."""
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid: Any = figure.subplots(2, 3)
    labels = ("disturbance to impact [ms]", "descent to impact [ms]", "pelvis speed at impact [m/s]")
    for axes, (name, (mean, sd)), label in zip(grid[0], CHOI.items(), labels, strict=True):
        axes.hist([each[name] for each in result["each"]], bins=14, color=STABLE, label="simulated falls")
        axes.axvspan(mean - sd, mean + sd, color=FALL, alpha=0.18, label="Choi et al. 2015, mean +- sd")
        axes.axvline(mean, color=FALL)
        axes.set_xlabel(label)
    grid[0, 0].set_ylabel("falls")
    grid[0, 0].legend(fontsize=8)
    _pushes(grid[1, 0], result)
    speeds = [each["speed_m_s"] for each in result["gait"]]
    grid[1, 1].plot(speeds, [each["step_length_m"] for each in result["gait"]], "o-", color=STABLE, label="simulated")
    line = np.linspace(0.2, 1.3, 50)
    grid[1, 1].plot(line, 0.62 * (line / 1.2) ** 0.42, color=FALL, label="speed$^{0.42}$ (Grieve and Gear 1966)")
    grid[1, 1].set_xlabel("walking speed [m/s]")
    grid[1, 1].set_ylabel("step length [m]")
    grid[1, 1].legend(fontsize=8)
    for each in result["gait"][1::2]:
        if each["stance"]:
            grid[1, 2].plot(np.linspace(0, 100, 101), each["stance"], label=f"{each['speed_m_s']:.1f} m/s")
    grid[1, 2].axhline(1.0, color=FAINT, linewidth=1)
    grid[1, 2].set_xlabel("stance [%]")
    grid[1, 2].set_ylabel("vertical force of one foot [body weight]")
    grid[1, 2].legend(fontsize=8)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out, dpi=90)


def _pushes(axes: Any, result: dict[str, Any]) -> None:
    recorded = recorded_detours()
    if recorded:
        axes.plot(*zip(*recorded, strict=True), ".", color=FAINT, markersize=3, label="29 people, none fell")
    for fell, marker, colour, label in (
        (False, "o", STABLE, "simulated, survived"),
        (True, "x", INK, "simulated, fell"),
    ):
        points = [(p["velocity_change_m_s"], p["detour_m"]) for p in result["pushes"] if p["fell"] == fell]
        if points:
            axes.plot(*zip(*points, strict=True), marker, color=colour, label=label)
    axes.set_xlabel("velocity change by the push [m/s]")
    axes.set_ylabel("detour [m]")
    axes.legend(fontsize=8)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--falls", type=int, default=60, help="disturbances drawn")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    result = measure(given.falls, given.seed)
    print(f"{result['fell']} of {result['drawn']} disturbances ended on the floor")
    for name, published in CHOI.items():
        own = result["falls"][name]
        print(f"{name:24} {own['mean']:8.2f} +- {own['sd']:.2f}   published {published[0]} +- {published[1]}")
    for each in result["gait"]:
        first, hollow, second = each["humps_weights"] or [float("nan")] * 3
        print(
            f"wanted {each['wanted_m_s']:.1f}: {each['speed_m_s']:.2f} m/s, {each['cadence_steps_min']:.0f} steps/min"
            f" of {each['step_length_m']:.2f} m (published {each['published_cadence_steps_min']:.0f} of"
            f" {each['published_step_length_m']:.2f} m), foot {first:.2f} / {hollow:.2f} / {second:.2f} weights"
        )
    for row in result["pushes_by_change"]:
        own, real = row["detour_m"], row["recorded_detour_m"]
        told = f"{own['mean']:.2f} +- {own['sd']:.2f} m" if own else "-"
        recorded = f"{real['mean']:.2f} +- {real['sd']:.2f} m of {row['recorded']}" if real else "no data"
        print(
            f"sideways by {row['velocity_change_m_s']:.1f} m/s: {row['survived']} of {row['of']} survived,"
            f" detour {told}; people: {recorded}"
        )
    if given.json:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        given.json.write_text(json.dumps(result, indent=1))
    if given.figure:
        draw(result, given.figure)


if __name__ == "__main__":
    main()
