"""What solving yields: a plan, or a failure that cannot be taken for one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from bridge.messages import Floats


class Residuals(NamedTuple):
    """How far a solution is from optimal, by our own count, in the problem's scaled units."""

    primal: float  # largest violation of a bound
    dual: float  # largest component of the Lagrangian's gradient, over 1 + its terms' size
    gap: float  # distance of primal from dual cost, over 1 + their size


@dataclass(frozen=True, slots=True)
class Plan:
    """An accepted solution: the motion over the horizon, from the present pose, in the present base frame."""

    acceleration: Floats  # (N, 4) of each stage [m/s^2, rad/s^2]
    velocity: Floats  # (N, 4) at each stage's end [m/s, rad/s]
    displacement: Floats  # (N, 4) at each stage's end [m, rad]
    residuals: Residuals
    iterations: int
    solve_time_s: float


@dataclass(frozen=True, slots=True)
class Failure:
    """An unsolved step, with its evidence. It holds no motion."""

    reason: str  # in words
    status: str  # the solver's own word, '' if it was not called
    iterations: int = 0
    residuals: Residuals | None = None
    solve_time_s: float = 0.0
