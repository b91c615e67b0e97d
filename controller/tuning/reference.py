"""A case through the very `Intervention` that runs live, turn by turn: slow, and the measure of `replay`."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from bridge.clock import NS
from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.inbox import Reading
from bridge.messages import FallHorizon, GaitState, Odometry, Wrench
from controller.intervention.intervention import Intervention
from controller.tuning.cases import Case, Felt, Stream
from controller.tuning.course import Stages, inputs
from controller.tuning.replay import STATES, Run, Transition
from controller.tuning.watching import Watched

M = TypeVar("M", FallHorizon, Wrench, Odometry)


def replay_live(
    case: Case, intervention: InterventionConfig, supervisor: SupervisorConfig, stages: Stages | None = None
) -> Run:
    """Return what `Intervention` does in `case`; risks are not told, they are its own affair."""
    stages = Stages() if stages is None else stages
    logic = Intervention(intervention, supervisor, stages.stages, stages.stage_s)
    known = inputs(case, supervisor)
    messages = [case.horizons.message(i) if not fault else None for i, fault in enumerate(case.horizons.stream.faults)]
    state, stiffening = np.zeros(case.ticks, np.int8), np.zeros(case.ticks)
    transitions: list[Transition] = []
    before = GaitState.DISARMED
    wrenches, odometries = _pulls(case.pull), _descents(case.descent)
    at_rest = Reading(_wrench(0, 0.0), 0.0, "", True), Reading(_odometry(0, 0.0), 0.0, "", True)
    for turn, now_ns in enumerate(case.times_ns.tolist()):
        horizon = _reading(case.horizons.stream, known.horizon, messages, turn, now_ns, supervisor.horizon_age_limit_s)
        wrench, odometry = at_rest
        if case.pull is not None and known.wrench is not None:
            wrench = _reading(
                case.pull.stream, known.wrench, wrenches, turn, now_ns, supervisor.wrench_age_limit_s
            )  # fmt: skip
        if case.descent is not None and known.odometry is not None:
            odometry = _reading(
                case.descent.stream, known.odometry, odometries, turn, now_ns, supervisor.odometry_age_limit_s
            )  # fmt: skip
        decision = logic.step(now_ns, horizon, wrench, odometry)
        if decision.state is not before:
            transitions.append(Transition(turn * case.period_ns / NS, before, decision.state, decision.reason))
            before = decision.state
        state[turn], stiffening[turn] = STATES.index(decision.state), decision.stiffening
    unknown = np.full(case.ticks, np.nan)
    return Run(case, state, stiffening, unknown, unknown, tuple(transitions))


def _reading(
    stream: Stream, watched: Watched, messages: list[M | None], turn: int, now_ns: int, limit_s: float
) -> Reading[M]:
    """Return what the inbox would say at a turn."""
    newest = int(watched.newest[turn])
    if newest < 0:
        return Reading(None, float("inf"), f"no {stream.key} received yet", False)
    age_s = (now_ns - int(stream.stamp_ns[newest])) / NS
    fault = stream.faults[newest]
    if not fault and age_s > limit_s:
        fault = f"{stream.key} is {age_s * 1e3:.0f} ms old, limit {limit_s * 1e3:.0f}"
    return Reading(messages[newest], age_s, fault, True)


def _pulls(felt: Felt | None) -> list[Wrench | None]:
    return [] if felt is None else [_wrench(0, float(value)) for value in felt.value]


def _descents(felt: Felt | None) -> list[Odometry | None]:
    return [] if felt is None else [_odometry(0, float(value)) for value in felt.value]


def _wrench(stamp_ns: int, pull_n: float) -> Wrench:
    return Wrench(stamp_ns=stamp_ns, force=np.array([0.0, 0.0, -pull_n]), torque=np.zeros(3))


def _odometry(stamp_ns: int, descent_m_s: float) -> Odometry:
    return Odometry(
        stamp_ns=stamp_ns, position=np.zeros(3), yaw=0.0, velocity=np.array([0.0, 0.0, -descent_m_s]), yaw_rate=0.0
    )
