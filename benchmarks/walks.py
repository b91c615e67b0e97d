"""Does undisturbed walking hold: people of many sizes at many speeds, on their own and in the harness.

    python -m benchmarks.walks --seconds 60 --json runs/bench/walks.json

In the harness the whole stack runs in lock-step, and the walker goes where the person wants by what it feels through
the straps: nobody tells it the speed.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import machine, report
from bridge.config.load import load_config
from simulation.campaign.trial import run_trial
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.scenario import Performance, Scenario, Wish

SIZES = (BodySize(1.50, 45), BodySize(1.60, 80), BodySize(1.70, 75), BodySize(1.75, 110), BodySize(1.95, 120))
SPEEDS = (0.3, 0.6, 0.9, 1.2)
IN_HARNESS = (BodySize(1.50, 45), BodySize(1.70, 75), BodySize(1.95, 120))
STARTS_S = 1.5
SETTLED_S = 5.0
REST = (0.0, 0.0, 0.0, 0.0)


def scenario(size: BodySize, speed: float, seconds: float) -> Scenario:
    """Return a walk straight on."""
    wish = Wish(STARTS_S, Intent(speed_m_s=speed))
    return Scenario("walk", "non_fall", "walking", size, (wish,), duration_s=seconds, seed=1)


def alone(size: BodySize, speed: float, seconds: float) -> dict[str, Any]:
    """Walk without harness."""
    performance = Performance(scenario(size, speed, seconds), worn=False)
    world = performance.world
    heights, start = [], world.pelvis_m.copy()
    while world.time_s < seconds and not world.person.fallen:
        performance.advance(REST)
        if world.time_s < SETTLED_S:
            start = world.pelvis_m.copy()
        else:
            heights.append(float(world.pelvis_m[2]))
    way = float(np.linalg.norm(world.pelvis_m[:2] - start[:2]))
    return {
        "held_s": round(world.time_s, 1), "holds": not world.person.fallen,
        "speed_m_s": way / max(world.time_s - SETTLED_S, 1e-9),
        "lowest_m": world.person.pelvis_height_m - min(heights, default=0.0),
    }  # fmt: skip


def harnessed(size: BodySize, speed: float, seconds: float) -> dict[str, Any]:
    """Walk in the harness with the whole stack."""
    measures, trace = run_trial(scenario(size, speed, seconds), "anticipatory", load_config(None))
    settled = trace.time_s >= SETTLED_S
    way, time_s = trace.walked_m[settled], trace.time_s[settled]
    return {
        "held_s": round(float(trace.time_s[-1]), 1), "holds": not measures.touched,
        "speed_m_s": float((way[-1] - way[0]) / (time_s[-1] - time_s[0])), "lowest_m": measures.pelvis_drop_m,
        "rms_force_n": measures.rms_force_n, "arrests": measures.arrests, "guards": measures.guards,
    }  # fmt: skip


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each walk")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--no-harness", action="store_true", help="leave out the walks with the whole stack")
    given = parser.parse_args()
    rows = []
    for kind, walk, sizes in (("alone", alone, SIZES), ("harness", harnessed, IN_HARNESS)):
        if kind == "harness" and given.no_harness:
            continue
        for size, speed in product(sizes, SPEEDS):
            row = {"kind": kind, "height_m": size.height_m, "mass_kg": size.mass_kg, "wanted_m_s": speed}
            row |= walk(size, speed, given.seconds)
            rows.append(row)
            print(" ".join(f"{k}={v:.2f}" if isinstance(v, float) else f"{k}={v}" for k, v in row.items()), flush=True)
    report({"machine": machine(), "seconds": given.seconds, "walks": rows}, given.json)


if __name__ == "__main__":
    main()
