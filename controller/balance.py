"""The last look at balance: what a plan's tolerance and the limiter behind it have made of the zero-moment point."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bridge.messages import Floats

_TOLERANCE = 1e-3  # of what the support margin allows; the rows themselves lie well inside the stated margin
_FORE_AND_BACK = ((0, 0, 1), (1, 2, 3))  # axis, row of its fore or left edge, row of its rear or right one


class TipLimits(NamedTuple):
    """Tip-over at one instant, by edge: front, rear, left, right. `rows @ a <= high` keeps upright."""

    rows: Floats  # (4, 4)
    high: Floats  # (4,)

    def excess(self, acceleration: Floats) -> float:
        """Return by how much `acceleration` (4,) breaks the limit it breaks most; at most 0 if it breaks none."""
        return float((self.rows @ acceleration - self.high).max())


def upright(wanted: Floats, limits: TipLimits, clamp: Callable[[Floats], Floats]) -> Floats:
    """Return the clamped acceleration, moved along x and y as far as it takes to stay upright.

    Limits of motion come first: what is out of reach is not asked for, and where nothing in reach keeps upright, what
    comes nearest to it is taken.

    Args:
        wanted: (4,) acceleration [m/s^2, rad/s^2].
        limits: tip-over under the present wrench.
        clamp: what the limits of motion make of an acceleration.
    """
    got = clamp(wanted)
    excess = limits.excess(got)
    if excess <= _TOLERANCE:
        return got
    moved = got.copy()
    for axis, fore, back in _FORE_AND_BACK:
        # Accelerating forward moves the zero-moment point back: the fore edge bounds from below.
        least, most = (
            float((limits.high[row] - limits.rows[row] @ moved) / limits.rows[row, axis] + moved[axis])
            for row in (fore, back)
        )
        moved[axis] = min(max(float(moved[axis]), least), most) if least <= most else 0.5 * (least + most)
    again = clamp(moved)
    return again if limits.excess(again) < excess else got


def no_limits() -> TipLimits:
    """Return limits that nothing breaks, for a walker of which nothing is known."""
    return TipLimits(np.zeros((4, 4)), np.full(4, np.inf))
