"""The motion of a base and a column that follow velocity commands with first-order lag."""

from __future__ import annotations

from math import cos, exp, sin
from typing import NamedTuple


class DriveState(NamedTuple):
    """Pose in the odometry frame, velocity in the support frame."""

    x: float = 0.0  # [m]
    y: float = 0.0  # [m]
    yaw: float = 0.0  # [rad], not wrapped
    height: float = 1.0  # of the column [m]
    forward: float = 0.0  # [m/s]
    left: float = 0.0  # [m/s]
    yaw_rate: float = 0.0  # [rad/s]
    column: float = 0.0  # [m/s]


class DriveModel(NamedTuple):
    """What the drive is made of."""

    base_lag_s: float
    column_lag_s: float
    column_low_m: float
    column_high_m: float

    def advance(self, state: DriveState, commanded: tuple[float, float, float, float], dt: float) -> DriveState:
        """Return the state `dt` later, with `commanded` velocities (forward, left, yaw, column) held meanwhile.

        Velocities relax as v(t) = u + (v0 - u) exp(-t / lag), integrated exactly; the base's
        displacement is turned by the mean yaw of the step (second order in dt).
        """
        forward, along = _lag(state.forward, commanded[0], self.base_lag_s, dt)
        left, across = _lag(state.left, commanded[1], self.base_lag_s, dt)
        yaw_rate, turn = _lag(state.yaw_rate, commanded[2], self.base_lag_s, dt)
        column, lift = _lag(state.column, commanded[3], self.column_lag_s, dt)
        c, s = cos(state.yaw + 0.5 * turn), sin(state.yaw + 0.5 * turn)
        height = state.height + lift
        if not self.column_low_m < height < self.column_high_m:  # the column stands at its end stop
            height = min(max(height, self.column_low_m), self.column_high_m)
            column = 0.0
        return DriveState(
            x=state.x + c * along - s * across,
            y=state.y + s * along + c * across,
            yaw=state.yaw + turn,
            height=height,
            forward=forward,
            left=left,
            yaw_rate=yaw_rate,
            column=column,
        )


def _lag(velocity: float, commanded: float, lag_s: float, dt: float) -> tuple[float, float]:
    """Return velocity after `dt` and the way made until then."""
    if lag_s <= 0.0:
        return commanded, commanded * dt
    decay = exp(-dt / lag_s)
    return commanded + (velocity - commanded) * decay, commanded * dt + (velocity - commanded) * lag_s * (1.0 - decay)
