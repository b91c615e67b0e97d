"""The safety gate: the last thing before the wire, and again the first thing on the drive's side.

Independent of whoever made the command: NumPy and the message types, nothing else. Per
axis the output velocity v follows the command under |v| <= V, |a| <= A and |da/dt| <= J with
v[k+1] = v[k] + a[k+1] dt for any period dt. A velocity can only be left alone if it can
still be turned round in time, so the gate also keeps v + a^2 / (2 J) <= V while a > 0 and its
mirror image; winding the acceleration down at J satisfies both from every state that
did, so there is always a way on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from bridge.errors import InvalidMessage
from bridge.messages import GaitState, SupportCommand

AXES: Final = ("forward velocity [m/s]", "left velocity [m/s]", "yaw rate [rad/s]", "column velocity [m/s]")
COLUMN: Final = 3
REST: Final = (0.0, 0.0, 0.0, 0.0)
NS: Final = 1_000_000_000
LONGEST_STEP_S: Final = 0.05  # time beyond this in which nobody called is time spent braking


@dataclass(frozen=True, slots=True)
class GateLimits:
    """What no command may exceed."""

    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    yaw_rate_rad_s: float
    yaw_acceleration_rad_s2: float
    yaw_jerk_rad_s3: float
    column_speed_m_s: float
    column_acceleration_m_s2: float
    column_jerk_m_s3: float
    column_low_m: float
    column_high_m: float
    lifetime_s: float
    future_tolerance_s: float
    excess_fraction: float
    frame_age_s: float

    def axes(self) -> tuple[AxisLimits, AxisLimits, AxisLimits, AxisLimits]:
        """Return the limits of forward, left, yaw and column."""
        base = AxisLimits(self.speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)
        yaw = AxisLimits(self.yaw_rate_rad_s, self.yaw_acceleration_rad_s2, self.yaw_jerk_rad_s3)
        column = AxisLimits(self.column_speed_m_s, self.column_acceleration_m_s2, self.column_jerk_m_s3)
        return (base, base, yaw, column)


class AxisLimits(NamedTuple):
    """Limits of one axis: V [m/s], A [m/s^2], J [m/s^3]; radians for yaw."""

    velocity: float
    acceleration: float
    jerk: float


class Held(NamedTuple):
    """The admittance that a stop holds with: base and column are kept where they are, as stiff as in an arrest."""

    damping: Sequence[float]  # (4,) [N s/m, N s/m, N m s/rad, N s/m]
    stiffness: Sequence[float]  # (4,) [N/m, N/m, N m/rad, N/m]


UNKNOWN: Final = Held(REST, REST)  # for gates whose output nobody renders forces from


class SafetyGate:
    """Lets a command pass, bends it to the limits, or puts the safe command in its place.

    The safe command brakes the base from the last output at its limits and holds the column;
    it has `valid=False`, solver `stop` and says why.
    """

    def __init__(
        self, limits: GateLimits, *, column_height_m: float, ordered: bool = True, held: Held = UNKNOWN
    ) -> None:
        """Start at rest.

        Args:
            limits: what no command may exceed.
            column_height_m: height to hold until the first command [m].
            ordered: refuse commands whose sequence number is not newer; False where none is filled in yet.
            held: what a stop says it holds with; a drive that renders forces must not find zeros there.
        """
        self._limits = limits
        self._axes = limits.axes()
        self._ordered = ordered
        self._held = held
        self._velocity = [0.0] * 4
        self._acceleration = [0.0] * 4
        self._target = [0.0] * 4  # velocity commanded last, for the slope of the command
        self._height = self._inside(column_height_m)
        self._now_ns: int | None = None
        self._sequence = -1
        self._stamp_ns = -1
        self._expiry_ns = -1
        self.passed = 0
        self.refused = 0

    def hold(self, column_height_m: float) -> None:
        """Take a measured column height as the one to hold; only until the first command has passed."""
        if self.passed == 0 and np.isfinite(column_height_m):
            self._height = self._inside(column_height_m)

    @property
    def at_rest(self) -> bool:
        """Whether the output has come to rest."""
        return max(map(abs, self._velocity)) < 1e-6

    def filter(self, command: SupportCommand | None, now_ns: int) -> SupportCommand:
        """Return what may be executed at `now_ns`: within every limit and rate, whatever came in.

        The same command may be given again until it expires.
        """
        dt = self._elapsed_s(now_ns)
        refusal = self._judge(command, now_ns)
        if command is None or refusal:
            self.refused += 1
            return self._stop(now_ns, dt, GaitState.SAFE_STOP, refusal, None)
        self._sequence, self._stamp_ns, self._expiry_ns = command.sequence, command.stamp_ns, self._expiry(command)
        if not command.valid:
            return self._stop(now_ns, dt, command.state, command.reason, command)
        self.passed += 1
        return self._follow(command, now_ns, dt)

    def _elapsed_s(self, now_ns: int) -> float:
        """Return the length of this step; what the caller slept away before it, the drive has spent braking."""
        before = now_ns if self._now_ns is None else self._now_ns
        self._now_ns = max(now_ns, before)
        left = (self._now_ns - before) / NS
        while left > LONGEST_STEP_S and not self.at_rest:
            self._brake(LONGEST_STEP_S)
            left -= LONGEST_STEP_S
        return min(left, LONGEST_STEP_S)

    def _judge(self, command: SupportCommand | None, now_ns: int) -> str:
        """Return why `command` must not be executed, or '' if it may."""
        if command is None:
            return "no command received yet"
        try:
            command.check()
        except InvalidMessage as error:
            return str(error)
        late = self._judge_time(command, now_ns) or self._judge_frame(command, now_ns)
        return late if late or not command.valid else self._judge_values(command)

    def _judge_time(self, command: SupportCommand, now_ns: int) -> str:
        age_ms = (now_ns - command.stamp_ns) / 1e6
        if age_ms < -self._limits.future_tolerance_s * 1e3:
            return f"command is stamped {-age_ms:.0f} ms ahead, limit {self._limits.future_tolerance_s * 1e3:.0f}"
        if now_ns > self._expiry(command):
            return f"command expired: {age_ms:.0f} ms old, limit {self._lifetime_s(command) * 1e3:.0f}"
        if command.stamp_ns < self._stamp_ns:
            return f"command is {(self._stamp_ns - command.stamp_ns) / 1e6:.0f} ms older than the one before"
        repeated = command.sequence == self._sequence and command.stamp_ns == self._stamp_ns
        # a publisher that restarted counts from zero again, but not before its last command has expired
        restarted = now_ns > self._expiry_ns and command.stamp_ns > self._stamp_ns
        if self._ordered and command.sequence <= self._sequence and not (repeated or restarted):
            return f"command {command.sequence} came after {self._sequence}"
        return ""

    def _judge_frame(self, command: SupportCommand, now_ns: int) -> str:
        """A controller that goes on about a picture that stands still stamps its commands as ever."""
        age_ms, limit_ms = (now_ns - command.rests_on_ns) / 1e6, self._limits.frame_age_s * 1e3
        if not command.valid or command.rests_on_ns == 0 or age_ms <= limit_ms:
            return ""
        return f"command rests on a camera frame {age_ms:.0f} ms old, limit {limit_ms:.0f}"

    def _judge_values(self, command: SupportCommand) -> str:
        slack = 1.0 + self._limits.excess_fraction
        for name, value, limit in zip(AXES, command.velocity.tolist(), self._axes, strict=True):
            if abs(value) > limit.velocity * slack:
                return f"command {name} is {value:.3g}, limit {limit.velocity:g}"
        low, high = self._limits.column_low_m, self._limits.column_high_m
        excess = (high - low) * self._limits.excess_fraction
        if not low - excess <= command.column_height <= high + excess:
            return f"command column_height is {command.column_height:.3g}, limits {low:g}..{high:g} m"
        return ""

    def _follow(self, command: SupportCommand, now_ns: int, dt: float) -> SupportCommand:
        velocity = command.velocity.tolist()
        velocity[COLUMN] = self._within_stroke(velocity[COLUMN])
        self._move(velocity, dt)
        reach = self._axes[COLUMN].velocity * dt
        self._height = self._inside(min(max(command.column_height, self._height - reach), self._height + reach))
        return SupportCommand(
            stamp_ns=now_ns,
            velocity=np.array(self._velocity),
            acceleration=np.array(self._acceleration),
            column_height=self._height,
            stiffening=command.stiffening,
            damping=command.damping,
            stiffness=command.stiffness,
            state=command.state,
            solver=command.solver,
            lifetime_s=self._lifetime_s(command),
            sequence=command.sequence,
            reason=command.reason,
            rests_on_ns=command.rests_on_ns,
            fall_distance=command.fall_distance,
            fall_probability=command.fall_probability,
            solve_time_s=command.solve_time_s,
            frame_id=command.frame_id,
        )

    def _stop(
        self, now_ns: int, dt: float, state: GaitState, reason: str, told: SupportCommand | None
    ) -> SupportCommand:
        """Brake; `told` is the safe command that asked for it, if one did, and lends what it knew of the person."""
        self._brake(dt)
        return SupportCommand(
            stamp_ns=now_ns,
            velocity=np.array(self._velocity),
            acceleration=np.array(self._acceleration),
            column_height=self._height,
            stiffening=1.0 if told is None else told.stiffening,
            damping=np.array(self._held.damping),
            stiffness=np.array(self._held.stiffness),
            state=state,
            solver="stop",
            lifetime_s=self._limits.lifetime_s,
            sequence=0 if told is None else told.sequence,
            valid=False,
            reason=reason,
            rests_on_ns=0 if told is None else told.rests_on_ns,
            fall_distance=np.nan if told is None else told.fall_distance,
            fall_probability=np.nan if told is None else told.fall_probability,
        )

    def _brake(self, dt: float) -> None:
        self._move(REST, dt)
        self._height = self._inside(self._height + self._velocity[COLUMN] * dt)

    def _move(self, target: Sequence[float], dt: float) -> None:
        """Advance velocity and acceleration of every axis by `dt` towards `target`."""
        if dt <= 0.0:
            return
        for i, limits in enumerate(self._axes):
            wanted = min(max(target[i], -limits.velocity), limits.velocity)
            slope = (wanted - self._target[i]) / dt
            self._target[i] = wanted
            self._velocity[i], self._acceleration[i] = follow_velocity(
                self._velocity[i], self._acceleration[i], wanted, slope, dt, limits
            )

    def _within_stroke(self, velocity: float) -> float:
        """Return the column velocity, reduced so that the column can stop before the end of its stroke."""
        _, A, J = self._axes[COLUMN]
        up = stopping_speed(self._limits.column_high_m - self._height, 0.5 * A, J)
        down = stopping_speed(self._height - self._limits.column_low_m, 0.5 * A, J)
        return min(max(velocity, -down), up)

    def _inside(self, height: float) -> float:
        return min(max(height, self._limits.column_low_m), self._limits.column_high_m)

    def _lifetime_s(self, command: SupportCommand) -> float:
        return min(command.lifetime_s, self._limits.lifetime_s)

    def _expiry(self, command: SupportCommand) -> int:
        return command.stamp_ns + round(self._lifetime_s(command) * NS)


def follow_velocity(
    v: float, a: float, target: float, slope: float, dt: float, limits: AxisLimits
) -> tuple[float, float]:
    """Return velocity and acceleration after `dt`, nearing `target` as fast as the limits allow without overshoot.

    Args:
        v: velocity now, |v| <= V and able to turn round in time [m/s].
        a: acceleration of the step before [m/s^2].
        target: commanded velocity at the end of the step, |target| <= V [m/s].
        slope: rate at which the command is changing [m/s^2]; a command within the limits is followed exactly.
        dt: length of the step, positive [s].
        limits: V, A, J.
    """
    V, A, J = limits
    slope = min(max(slope, -A), A)
    wanted = slope + _closing(target - v - slope * dt, dt, J)
    low = max(a - J * dt, -A, -_closing(V + v, dt, J))
    high = min(a + J * dt, A, _closing(V - v, dt, J))
    a = min(max(wanted, low), high)
    return min(max(v + a * dt, -V), V), a


def stopping_speed(room: float, A: float, J: float) -> float:
    """Return the largest speed v with v^2 / (2 A) + v A / (2 J) <= `room`: stop within it, starting without braking."""
    lead = A * A / (2.0 * J)
    return sqrt(lead * lead + 2.0 * A * max(room, 0.0)) - lead


def _closing(gap: float, dt: float, J: float) -> float:
    """Return the largest x with x dt + x^2 / (2 J) <= `gap`: the rate that can still be wound down at J in time."""
    if gap < 0.0:
        return -_closing(-gap, dt, J)
    return 2.0 * gap / (dt + sqrt(dt * dt + 2.0 * gap / J))
