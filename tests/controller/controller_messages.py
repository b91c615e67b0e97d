"""Messages and readings the controller's tests are made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from bridge.inbox import Reading
from bridge.messages import STEPS, FallHorizon, GaitState, Odometry, SupportCommand, Wrench

NS = 1_000_000_000
MS = 1_000_000


def horizon(
    stamp_ns: int = NS,
    distance: Any = 5.0,
    rate: Any = 0.0,
    fall: Any = 0.0,
    quality: float = 1.0,
    transient: Any = None,
    **changes: Any,
) -> FallHorizon:
    """Return a horizon; scalars hold for every step. What is not `fall` is transient, or else as said."""
    probability = np.broadcast_to(np.asarray(fall, dtype=float), (STEPS,))
    between = 1.0 - probability if transient is None else np.broadcast_to(np.asarray(transient, dtype=float), (STEPS,))
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=np.stack([1.0 - between - probability, between, probability], axis=1),
        distance=np.broadcast_to(np.asarray(distance, dtype=float), (STEPS,)),
        distance_rate=np.broadcast_to(np.asarray(rate, dtype=float), (STEPS,)),
        time_to_boundary=np.full(STEPS, np.inf),
        centre_distance=np.zeros((STEPS, 3)),
        plane=np.zeros((STEPS, 2)),
        forecast_px=np.zeros((STEPS, 12, 2)),
        quality=quality,
        **changes,
    )


def wrench(stamp_ns: int = NS, force: Any = (0.0, 0.0, 0.0)) -> Wrench:
    return Wrench(stamp_ns=stamp_ns, force=np.array(force, dtype=float), torque=np.zeros(3))


def odometry(stamp_ns: int = NS, descent: float = 0.0, height: float = 1.0) -> Odometry:
    return Odometry(
        stamp_ns=stamp_ns,
        position=np.array([0.0, 0.0, height]),
        yaw=0.0,
        velocity=np.array([0.0, 0.0, -descent]),
        yaw_rate=0.0,
    )


def good(message: Any, age_s: float = 0.0) -> Reading[Any]:
    return Reading(message, age_s, "", True)


def bad(fault: str) -> Reading[Any]:
    return Reading(None, float("inf"), fault, False)


def command(stamp_ns: int = NS, **changes: Any) -> SupportCommand:
    """Return a command to stand still at 1 m."""
    values: dict[str, Any] = {
        "velocity": np.zeros(4),
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": 0.0,
        "damping": np.full(4, 30.0),
        "stiffness": np.full(4, 10.0),
        "state": GaitState.FOLLOW,
        "solver": "mpc",
        "lifetime_s": 0.06,
        "reason": "walking",
    }
    values.update(changes)
    return SupportCommand(stamp_ns=stamp_ns, **values)
