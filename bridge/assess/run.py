"""One clip through perception, anticipation and intervention, in simulated time."""

from __future__ import annotations

from importlib import import_module
from typing import Final, NamedTuple

import numpy as np

from bridge.assess.clips import Clip
from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.inbox import Inbox
from bridge.lockstep import LockStep
from bridge.messages import STEPS, FallHorizon, Floats, GaitState, SupportCommand
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND

START_NS: Final = 1_000 * NS


class Assessment(NamedTuple):
    """What the system made of every frame of a clip; NaN where there was no valid horizon."""

    probabilities: Floats  # (N, 16, 3) stable, transient, fall at 0, 1/30, ..., 15/30 s
    distance: Floats  # (N, 16) signed distance to the fall boundary [within-class sd]
    stiffening: Floats  # (N,) present stiffening, 0..1
    state: np.ndarray  # (N,) text: state of the supervisor
    quality: Floats  # (N,) 0..1
    risk: Floats  # (N, 16) what the thresholds make of each step of the horizon, 0..1


def assess_clip(clip: Clip, config: SurefootConfig) -> Assessment:
    """Run the live nodes over `clip` as fast as they go.

    The walker is taken as healthy and unloaded: the drive without a robot stands
    still and feels no wrench, so every intervention comes from what the camera saw.
    The controller is the logging mock: the intervention logic runs whole, no
    command is optimised.
    """
    system = LockStep(
        config,
        {
            "perception": ("perception.node", {"source": f"{clip.path}:{clip.name}"}),
            "anticipation": ("anticipation.node", {}),
            "drive": ("simulation.drive.node", {"script": "zero"}),
            "controller": ("controller.node", {"controller": "log"}),
        },
        START_NS,
    )
    try:
        return _run(clip, system, config)
    finally:
        system.close()


def _run(clip: Clip, system: LockStep, config: SurefootConfig) -> Assessment:
    assess_risk = import_module("controller.intervention.risk").assess_risk
    wire = system.hub.transport()
    horizons: Inbox[FallHorizon] = Inbox(wire, FALL_HORIZON, max_age_s=float("inf"))
    commands: Inbox[SupportCommand] = Inbox(wire, SUPPORT_COMMAND, max_age_s=float("inf"))
    frames = len(clip.stamps_ns)
    result = Assessment(
        probabilities=np.full((frames, STEPS, 3), np.nan),
        distance=np.full((frames, STEPS), np.nan),
        stiffening=np.full(frames, np.nan),
        state=np.full(frames, GaitState.DISARMED.value, dtype="<U9"),
        quality=np.full(frames, np.nan),
        risk=np.full((frames, STEPS), np.nan),
    )
    seen = False
    for frame, offset_ns in enumerate(clip.stamps_ns):
        system.advance_to(START_NS + offset_ns)
        system.settle()
        horizon = horizons.read(system.clock.now_ns())
        seen = seen or horizon.message is not None
        if not seen:  # before the first full window
            continue
        if horizon.ok and horizon.message is not None:
            result.probabilities[frame] = horizon.message.probabilities
            result.distance[frame] = horizon.message.distance
            result.quality[frame] = horizon.message.quality
            result.risk[frame] = assess_risk(horizon.message, config.intervention).total
        else:
            result.quality[frame] = 0.0
        command = commands.read(system.clock.now_ns()).message
        if command is not None:
            result.stiffening[frame] = command.stiffening
            result.state[frame] = command.state.value
    return result
