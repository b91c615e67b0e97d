"""From what was heard to a row of the table: time to the safe command, reason, jumps, return to work. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.messages import Floats, GaitState, Odometry, SupportCommand
from controller.gate import GateLimits

MS: Final = 1e6  # nanoseconds in one
STOPPED: Final = (GaitState.DISARMED, GaitState.SAFE_STOP)
TOLERANCE: Final = 1.02  # of the limits: stamps are whole nanoseconds, values float64
FLOOR: Final = 1e-9


@dataclass(frozen=True)
class Outcome:
    """One row."""

    row: str  # NAME of the fault / stream or process
    group: str
    limit_ms: float | None  # to the safe command; None: work is to go on
    safe_ms: float | None  # from the stamp of the last good sample to the safe command
    reason: str
    jump: float  # largest change between two commands as a share of what the gate allows; 1 = at the limit
    back_s: float | None  # from the end of the fault to following again
    problems: tuple[str, ...] = ()
    note: str = ""
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        return not self.problems

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


class Timed(NamedTuple):
    """A message and when it was heard [ns]."""

    arrival_ns: int
    message: Any
    source: bytes
    number: int = 0  # counts up by one per publisher


def first_stop(commands: Iterable[Timed], since_ns: int) -> Timed | None:
    """Return the first safe command that was heard after `since_ns`."""
    return next((c for c in commands if c.arrival_ns >= since_ns and c.message.state in STOPPED), None)


def first_follow(commands: Iterable[Timed], since_ns: int) -> Timed | None:
    """Return the first command that moves again, heard after `since_ns`."""
    return next((c for c in commands if c.arrival_ns >= since_ns and follows(c.message)), None)


def follows(command: SupportCommand) -> bool:
    """Whether a command is one to be followed, and not the safe one."""
    return command.valid and command.state not in STOPPED


def largest_jump(commands: Sequence[Timed], limits: GateLimits) -> float:
    """Return the largest share of what the gate allows in velocity, acceleration and jerk."""
    worst = 0.0
    for before, after in pairwise(commands):
        if before.source != after.source:
            continue  # a new process begins at rest; what the drive makes of it is judged by the drive's motion
        dt = (after.message.stamp_ns - before.message.stamp_ns) / 1e9
        if dt > 0.0:
            worst = max(worst, _step(before.message.velocity, after.message.velocity, dt, limits))
            worst = max(worst, _turn(before.message.acceleration, after.message.acceleration, dt, limits))
    return worst


def largest_motion_jump(motion: Sequence[Timed], limits: GateLimits) -> float:
    """Return the largest share of the allowed acceleration in what the drive executed.

    Odometry k shows the velocity that was executed from k-1 on, so its change belongs to the period before;
    where a sample was lost in between, to the whole time.
    """
    worst = 0.0
    for first, second, third in zip(motion, motion[1:], motion[2:], strict=False):
        if not first.source == second.source == third.source:
            continue  # the drive without a robot starts again at rest
        whole = first.number + 2 == second.number + 1 == third.number
        dt = ((second if whole else third).message.stamp_ns - first.message.stamp_ns) / 1e9
        if dt > 0.0:
            worst = max(worst, _step(_velocity(second.message), _velocity(third.message), dt, limits))
    return worst


def braking_since(motion: Sequence[Timed], since_ns: int, limits: GateLimits) -> int | None:
    """Return when the drive began to brake for good after `since_ns` [ns], by its own clock; None if it did not.

    Braking at the limit is an acceleration that falls at the jerk limit to the largest deceleration: the first
    sample of that ramp counts.
    """
    points = [(m.message.stamp_ns, float(m.message.velocity[0])) for m in motion]
    slopes = [  # acceleration executed from `stamp` on: shown one sample later
        (points[k - 1][0], (points[k][1] - points[k - 1][1]) / ((points[k - 1][0] - points[k - 2][0]) / 1e9))
        for k in range(2, len(points))
        if points[k - 1][0] > points[k - 2][0]
    ]
    hard = next(
        (k for k, (stamp, a) in enumerate(slopes) if stamp >= since_ns and a <= -0.6 * limits.acceleration_m_s2), None
    )
    if hard is None:
        return None
    ramp = 0.1 * limits.acceleration_m_s2
    while hard > 1 and slopes[hard - 2][1] - slopes[hard - 1][1] > ramp:
        hard -= 1
    began_ns: int = slopes[hard][0]
    return began_ns


def lowest_speed(motion: Iterable[Timed], since_ns: int, until_ns: int) -> float:
    """Return the lowest forward speed in between [m/s]."""
    return min(
        (float(m.message.velocity[0]) for m in motion if since_ns <= m.arrival_ns <= until_ns), default=float("nan")
    )


def _velocity(odometry: Odometry) -> Floats:
    vx, vy, column = odometry.velocity
    return np.array([vx, vy, odometry.yaw_rate, column])


def _step(before: Floats, after: Floats, dt: float, limits: GateLimits) -> float:
    bounds = np.array([axis.acceleration for axis in limits.axes()]) * dt + FLOOR
    return float((np.abs(after - before) / bounds).max())


def _turn(before: Floats, after: Floats, dt: float, limits: GateLimits) -> float:
    bounds = np.array([axis.jerk for axis in limits.axes()]) * dt + FLOOR
    return float((np.abs(after - before) / bounds).max())
