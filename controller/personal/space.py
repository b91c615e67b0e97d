"""The settings that may be proposed: a box of mass and damping values, less what is not safe to render.

People feel ratios and not differences (Weber's law), so the box is searched in logarithms: the unit cube's side
is from a value's least to its greatest, and its middle is their geometric mean.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bridge.messages import Floats

DIGITS = 3  # nobody feels a thousandth, and a person has to read and copy the numbers


@dataclass(frozen=True)
class Parameter:
    """One number of the configuration and where it may lie."""

    key: str  # name in [admittance], with its unit
    low: float
    high: float
    present: float  # what the configuration says now


@dataclass(frozen=True)
class Space:
    """Parameters, and which of their combinations may be rendered.

    Attributes:
        parameters: the sides of the box.
        safe: (P, d) values -> (P,) whether each may be proposed.
    """

    parameters: tuple[Parameter, ...]
    safe: Callable[[Floats], NDArray[np.bool_]]

    @property
    def present(self) -> Floats:
        """What the configuration says now, (d,)."""
        return np.array([parameter.present for parameter in self.parameters])

    def unit(self, values: Floats) -> Floats:
        """Return values (..., d) as points of the unit cube."""
        low, high = self._sides()
        point: Floats = (np.log(values) - low) / (high - low)
        return point

    def values(self, points: Floats) -> Floats:
        """Return points (..., d) of the unit cube as values, rounded as they are shown and inside the box."""
        low, high = self._sides()
        raw = np.exp(low + np.clip(points, 0.0, 1.0) * (high - low))
        size = 10.0 ** (np.floor(np.log10(raw)) - DIGITS + 1)
        bounds = np.array([(parameter.low, parameter.high) for parameter in self.parameters])
        # dividing by a whole number keeps 22.1 from becoming 22.1000000001
        rounded = np.where(size < 1.0, np.round(raw / size) / np.round(1.0 / size), np.round(raw / size) * size)
        value: Floats = np.clip(rounded, bounds[:, 0], bounds[:, 1])
        return value

    def draw(self, count: int, rng: np.random.Generator, middle: Floats | None = None) -> Floats:
        """Return values (P, d) that may be proposed, P <= count: anywhere, or half of them near `middle` (d,).

        Near is near on every scale: the length of a step from `middle` is drawn evenly in its logarithm.
        """
        points = rng.random((count, len(self.parameters)))
        if middle is not None:
            step = rng.normal(size=points.shape) * 50.0 ** -rng.random((count, 1)) / 2
            near = np.arange(count) % 2 == 0
            points[near] = (self.unit(middle) + step)[near]
        values = self.values(points[np.all((points >= 0.0) & (points <= 1.0), axis=1)])
        allowed: Floats = values[self.safe(values)]
        return allowed

    def _sides(self) -> tuple[Floats, Floats]:
        bounds = np.log([(parameter.low, parameter.high) for parameter in self.parameters])
        return bounds[:, 0], bounds[:, 1]
