"""What solving yields: a plan, or a failure that cannot be taken for one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from bridge.messages import Floats


class Residuals(NamedTuple):
    """How far a solution is from optimal, by our own count, in the problem's scaled units."""

    primal: float  # largest violation of a bound
    dual: float  # largest component of the Lagrangian's gradient, over 1 + the cost's own
    gap: float  # distance of primal from dual cost, over 1 + their size


@dataclass(frozen=True, slots=True)
class Plan:
    """An accepted solution: the motion over the horizon, from the present pose, in the present base frame."""

    stages: Floats  # (N, 12) acceleration of each stage, velocity and displacement at its end (4 each)
    residuals: Residuals
    iterations: int
    solve_time_s: float

    @property
    def acceleration(self) -> Floats:
        """Acceleration of each stage (N, 4) [m/s^2, rad/s^2]."""
        return self.stages[:, 0:4]

    @property
    def velocity(self) -> Floats:
        """Velocity at each stage's end (N, 4) [m/s, rad/s]."""
        return self.stages[:, 4:8]

    @property
    def displacement(self) -> Floats:
        """Displacement at each stage's end (N, 4) [m, rad]."""
        return self.stages[:, 8:12]


@dataclass(frozen=True, slots=True)
class Failure:
    """An unsolved step, with its evidence. It holds no motion."""

    reason: str  # in words
    status: str  # the solver's own word, '' if it was not called
    iterations: int = 0
    residuals: Residuals | None = None
    solve_time_s: float = 0.0
