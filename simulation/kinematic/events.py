"""What can happen to a walking person: a stumble that is survived, sitting down; a fall is in fall.py.

Each event changes the gait's pace, the posture and how the whole body is turned. All are
functions of time alone, so that a motion is the same at every frame rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from simulation.kinematic.body import Floats, Posture, add, blend, standing

STEP_S: Final = 1.0 / 480.0  # grid of all motion and integration; frames take the nearest time on it


class Event(Protocol):
    """Something that begins at `at_s`."""

    @property
    def at_s(self) -> float:
        """When it begins [s]."""
        ...

    def pace(self, time_s: Floats) -> Floats:
        """Return the factor (T,) on the speed of walking."""
        ...

    def posture(self, time_s: Floats, before: Posture) -> Posture:
        """Return what becomes of the posture `before`."""
        ...

    def attitude(self, time_s: Floats) -> Floats:
        """Return how the whole body is turned (T, 3, 3), the identity while upright."""
        ...

    def label(self, time_s: Floats) -> Floats:
        """Return -1 (stable), 0 (falling) or 1 (lying) at each time (T,)."""
        ...


@dataclass(frozen=True, slots=True)
class Stumble:
    """The left foot is caught in swing; a lowered body, a bent trunk and a quick long step save the person.

    The course follows the elevating strategy of Eng, Winter and Patla (1994), "Strategies for recovery
    from a trip in early and late swing", Exp. Brain Research 102: trunk flexion of 20 to 30 degrees, a
    raised swing leg with more flexion at hip and knee, arms outward, over within about a second.
    """

    at_s: float
    size: float = 1.0
    duration_s: float = 1.2

    def pace(self, time_s: Floats) -> Floats:
        """The stride hesitates, then catches up."""
        held = _pulse(time_s, self.at_s, 0.12, 0.35)
        hurried = _pulse(time_s, self.at_s + 0.25, 0.20, 0.60)
        return np.asarray(1.0 - 0.55 * self.size * held + 0.35 * self.size * hurried)

    def posture(self, time_s: Floats, before: Posture) -> Posture:
        """Add what the recovery does to the posture."""
        trunk, legs, arms = standing(len(time_s)), standing(len(time_s)), standing(len(time_s))
        trunk.pelvis[:, 1], trunk.trunk[:, 1] = np.radians(9.0), np.radians(15.0)
        trunk.trunk[:, 2] = np.radians(5.0)
        legs.hip[:, 0, 0], legs.knee[:, 0] = np.radians(16.0), np.radians(24.0)
        legs.hip[:, 1, 0], legs.knee[:, 1], legs.ankle[:, 1] = np.radians(12.0), np.radians(20.0), np.radians(8.0)
        arms.shoulder[:, :, 0], arms.shoulder[:, :, 1] = np.radians(22.0), np.radians(28.0)
        arms.elbow[:] = np.radians(25.0)
        after = add(before, trunk, self.size * _pulse(time_s, self.at_s + 0.05, 0.30, self.duration_s))
        after = add(after, legs, self.size * _pulse(time_s, self.at_s, 0.25, 0.8 * self.duration_s))
        return add(after, arms, self.size * _pulse(time_s, self.at_s + 0.10, 0.22, 0.9 * self.duration_s))

    def attitude(self, time_s: Floats) -> Floats:
        """A stumble does not topple the body."""
        return upright(len(time_s))

    def label(self, time_s: Floats) -> Floats:
        """What is survived is stable, as the data sets label it."""
        return np.full(len(time_s), -1.0)


@dataclass(frozen=True, slots=True)
class Sit:
    """Stop, sit down on a chair of knee height, and stand up again after `stay_s` if that is finite."""

    at_s: float
    stay_s: float = float("inf")
    lower_s: float = 1.4

    def pace(self, time_s: Floats) -> Floats:
        """Walking ends within half a second."""
        return 1.0 - smooth((time_s - self.at_s) / 0.5)

    def posture(self, time_s: Floats, before: Posture) -> Posture:
        """Go through bending the trunk forward to sitting upright."""
        down = smooth((time_s - self.at_s - 0.4) / self.lower_s)
        if np.isfinite(self.stay_s):
            down = down - smooth((time_s - self.at_s - 0.4 - self.lower_s - self.stay_s) / self.lower_s)
        seat = standing(len(time_s))
        seat.hip[:, :, 0], seat.knee[:] = np.radians(88.0), np.radians(88.0)
        seat.hip[:, :, 1] = np.radians(6.0)
        seat.shoulder[:, :, 0], seat.elbow[:] = np.radians(25.0), np.radians(55.0)
        lean = 4.0 * down * (1.0 - down)
        seat.pelvis[:, 1] = np.radians(22.0) * lean
        seat.trunk[:, 1] = np.radians(20.0) * lean
        seat.hip[:, :, 0] += np.radians(22.0) * lean[:, None]  # the thighs do not follow the pelvis
        stand = blend(before, standing(len(time_s)), smooth((time_s - self.at_s) / 0.5))
        return blend(stand, seat, down)

    def attitude(self, time_s: Floats) -> Floats:
        """Sitting does not topple the body."""
        return upright(len(time_s))

    def label(self, time_s: Floats) -> Floats:
        """Sitting is stable."""
        return np.full(len(time_s), -1.0)


def upright(frames: int) -> Floats:
    """Return (T, 3, 3) identities."""
    return np.broadcast_to(np.eye(3), (frames, 3, 3))


def smooth(share: Floats) -> Floats:
    """Return 0 before 0, 1 after 1, and the quintic of least jerk between (Flash and Hogan, 1985)."""
    u = np.clip(share, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


def _pulse(time_s: Floats, start_s: float, rise_s: float, duration_s: float) -> Floats:
    """Rise from 0 to 1 within `rise_s` of the start, fall back to 0 by the end of `duration_s`."""
    since = time_s - start_s
    return smooth(since / rise_s) * (1.0 - smooth((since - rise_s) / (duration_s - rise_s)))
