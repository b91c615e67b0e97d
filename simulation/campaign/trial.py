"""One scenario in one arm: the very nodes that run live, in simulated time."""

from __future__ import annotations

from contextlib import nullcontext
from math import nan
from pathlib import Path
from typing import Final

from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.lockstep import LockStep
from simulation.campaign.arms import configured
from simulation.campaign.measures import Measures, measure
from simulation.campaign.node import listening
from simulation.campaign.recordings import TrialRecording, falls_csv
from simulation.campaign.trace import Recorder, Trace
from simulation.node import SimulationNode, performing
from simulation.scenarios.scenario import Performance, Scenario

START_NS: Final = 1_000 * NS
TURN_NS: Final = NS // 100
AFTER_CONTACT_S: Final = 0.3  # nothing more is learnt of who lies on the floor


def run_trial(scenario: Scenario, arm: str, config: SurefootConfig, keep: Path | None = None) -> tuple[Measures, Trace]:
    """Return the numbers and the trace of `scenario` in `arm`; the same arguments give the same result.

    What was on the wire is recorded into `keep` (`.mcap`), if that is given, with a list of falls beside it.
    """
    performance = Performance(scenario, slack_m=config.simulation.harness_slack_m)
    recorder = Recorder(START_NS)
    performance.watchers.append(recorder.note)
    made: list[SimulationNode] = []
    stack = LockStep(
        configured(config, arm, scenario.seed),
        {
            "perception": ("perception.node", {"source": "wire"}),
            "anticipation": ("anticipation.node", {}),
            "listener": (listening(recorder.heard), {}),
            "drive": (performing(performance, made.append), {}),
            "controller": ("controller.node", {}),
        },
        START_NS,
    )
    standing_m = performance.world.person.pelvis_height_m
    kept = nullcontext() if keep is None else TrialRecording(keep, stack, config.bridge.namespace)
    with kept as recording:
        try:
            touched_s = float("inf")
            for turn in range(round(scenario.duration_s * NS / TURN_NS)):
                stack.advance_to(START_NS + turn * TURN_NS)
                recorder.command = made[0].executed
                now_s = performance.world.time_s
                if recorder.touched:
                    touched_s = min(touched_s, now_s)
                if now_s > touched_s + AFTER_CONTACT_S:
                    break
        finally:
            stack.close()
        trace = recorder.trace()
        measures = measure(scenario, trace, performance.disturbed_s, standing_m)
        if recording is not None and keep is not None:
            descent_s = (performance.disturbed_s or 0.0) + measures.descent_s if scenario.kind == "fall" else nan
            recording.finish(falls_csv(keep.name, trace, descent_s, standing_m - scenario.lowered_m))
    return measures, trace
