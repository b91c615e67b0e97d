"""How fast the simulated world runs on one core: without the networks, and with the whole stack in lock-step.

    python -m benchmarks.simulation --json runs/bench/simulation.json

Times are processor times of one thread, as ratios of simulated time; 5 and 1 are wanted. Loading the networks and
building the controller is not counted.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import machine, report
from bridge.clock import NS
from bridge.config.load import load_config
from bridge.lockstep import LockStep
from simulation.campaign.arms import configured
from simulation.campaign.trial import START_NS, TURN_NS
from simulation.node import performing
from simulation.person.anthropometry import BodySize
from simulation.person.person import CONTROL_S, Intent
from simulation.scenarios.disturbance import Push
from simulation.scenarios.scenario import Performance, Scenario, Wish

SLICE_S = 1.0


def scenario(seconds: float) -> Scenario:
    """Return a walk that ends with a push two seconds before the end."""
    return Scenario(
        title="walk and push", kind="fall", family="push", size=BodySize(1.70, 75.0),
        wishes=(Wish(1.0, Intent(speed_m_s=0.6)),), disturbances=(Push(seconds - 2.0, 90.0),), duration_s=seconds,
    )  # fmt: skip


def world_alone(seconds: float) -> list[float]:
    """Return the speed of each simulated second without any node."""
    performance = Performance(scenario(seconds))
    speeds = []
    for _ in range(int(seconds / SLICE_S)):
        began = time.process_time()
        for _ in range(round(SLICE_S / CONTROL_S)):
            performance.advance((0.5, 0.0, 0.0, 0.0))
        speeds.append(SLICE_S / (time.process_time() - began))
    return speeds


def whole_stack(seconds: float) -> list[float]:
    """Return the speed of each simulated second with perception, anticipation, controller and drive."""
    performance = Performance(scenario(seconds))
    stack = LockStep(
        configured(load_config(None), "anticipatory", 0),
        {
            "perception": ("perception.node", {"source": "wire"}),
            "anticipation": ("anticipation.node", {}),
            "drive": (performing(performance, lambda _: None), {}),
            "controller": ("controller.node", {}),
        },
        START_NS,
    )
    speeds = []
    turns = round(SLICE_S * NS / TURN_NS)
    for second in range(int(seconds / SLICE_S)):
        began = time.process_time()
        for turn in range(second * turns, (second + 1) * turns):
            stack.advance_to(START_NS + turn * TURN_NS)
        speeds.append(SLICE_S / (time.process_time() - began))
    stack.close()
    return speeds[1:]  # the first second builds what is built once


def told(speeds: list[float]) -> dict[str, Any]:
    """Return median and slowest."""
    return {"times_real_time_median": round(float(np.median(speeds)), 2), "slowest_second": round(min(speeds), 2)}


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    report(
        {
            "machine": machine(),
            "world_alone": told(world_alone(arguments.seconds)),
            "whole_stack": told(whole_stack(arguments.seconds)),
        },
        arguments.json,
    )


if __name__ == "__main__":
    main()
