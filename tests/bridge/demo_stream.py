"""A synthetic run: the messages that the demo would have seen, made without any process."""

import numpy as np

from bridge.clock import NS
from bridge.messages import (
    FallHorizon,
    GaitState,
    Keypoints,
    KeypointStatus,
    Odometry,
    SupportCommand,
    Wrench,
)

ORIGIN_NS = 1_700_000_000 * NS
LINKS = np.array([(0, 2), (2, 4), (1, 3), (3, 5), (6, 8), (8, 10), (7, 9), (9, 11), (0, 1), (6, 7), (0, 6), (1, 7)])


def stamp(time_s: float) -> int:
    return ORIGIN_NS + round(time_s * NS)


def keypoints(time_s: float, sequence: int | None = None, **changes) -> Keypoints:
    fields = {
        "stamp_ns": stamp(time_s),
        "sequence": round(time_s * 30) if sequence is None else sequence,
        "position_px": np.arange(24.0).reshape(12, 2) + 10.0 * time_s,
        "confidence": np.full(12, 0.8),
        "status": np.full(12, KeypointStatus.MEASURED, dtype=np.uint8),
        "body_length_px": 90.0,
        "image_width": 320,
        "image_height": 240,
    }
    return Keypoints(**(fields | changes))


def horizon(time_s: float, fall: float = 0.1, distance: float = 3.0, **changes) -> FallHorizon:
    ahead = np.linspace(fall, min(1.0, fall + 0.2), 16)
    fields = {
        "stamp_ns": stamp(time_s),
        "probabilities": np.stack([0.75 * (1 - ahead), 0.25 * (1 - ahead), ahead], axis=1),
        "distance": np.linspace(distance, distance - 1.0, 16),
        "distance_rate": np.full(16, -2.0),
        "time_to_boundary": np.full(16, np.inf),
        "centre_distance": np.ones((16, 3)),
        "plane": np.zeros((16, 2)),
        "forecast_px": np.broadcast_to(np.arange(24.0).reshape(12, 2), (16, 12, 2)) + 10.0 * time_s + 5.0,
        "quality": 0.9,
    }
    return FallHorizon(**(fields | changes))


def command(time_s: float, state: GaitState = GaitState.FOLLOW, stiffening: float = 0.0, **changes) -> SupportCommand:
    fields = {
        "stamp_ns": stamp(time_s),
        "sequence": round(time_s * 100),
        "velocity": np.array([0.4, 0.0, 0.0, 0.0]),
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": stiffening,
        "damping": np.full(4, 40.0 + 400.0 * stiffening),
        "stiffness": np.full(4, 2000.0 * stiffening),
        "state": state,
        "solver": "mpc",
        "lifetime_s": 0.05,
        "reason": f"because {state.value}",
        "rests_on_ns": stamp(np.floor(time_s * 30) / 30),
    }
    return SupportCommand(**(fields | changes))


def odometry(time_s: float, velocity: float = 0.38) -> Odometry:
    return Odometry(
        stamp_ns=stamp(time_s),
        position=np.array([time_s, 0.0, 0.99]),
        yaw=0.0,
        velocity=np.array([velocity, 0.0, 0.0]),
        yaw_rate=0.0,
    )


def wrench(time_s: float) -> Wrench:
    return Wrench(stamp_ns=stamp(time_s), force=np.array([12.0, 0.0, -30.0]), torque=np.zeros(3))


def state_at(time_s: float) -> tuple[GaitState, float]:
    """Walk, guard from 2 s, arrest from 2.5 s."""
    if time_s < 2.0:
        return GaitState.FOLLOW, 0.0
    return (GaitState.GUARD, 0.3) if time_s < 2.5 else (GaitState.ARREST, 1.0)


def run(recorder, duration_s: float = 3.5, without: tuple[str, ...] = ()) -> None:
    """Feed a whole run; `without` names streams that stay silent."""
    for tick in range(round(duration_s * 100) + 1):
        time_s = tick / 100
        if tick % 10 in (0, 3, 7):
            if "keypoints" not in without:
                recorder.add(keypoints(round(time_s * 30) / 30))
            if "horizon" not in without:
                recorder.add(horizon(round(time_s * 30) / 30))
        if "odometry" not in without:
            recorder.add(odometry(time_s))
        if "wrench" not in without:
            recorder.add(wrench(time_s))
        if "command" not in without:
            recorder.add(command(time_s, *state_at(time_s)), arrival_ns=stamp(time_s + 0.004))
