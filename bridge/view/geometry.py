"""The transient plane's regions as polygons and its fall boundary as lines."""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bridge.messages import CLASSES, FallHorizon, Floats

AGREEMENT_SD: Final = 1e-3  # a horizon of the same plane agrees to rounding
_FALL: Final = CLASSES.index("fall")


class Plane(Protocol):
    """What is needed of `anticipation.transient.TransientPlane`."""

    @property
    def centres(self) -> Floats:
        """Class centres (3, 2) [sd]."""
        ...

    @property
    def weights(self) -> Floats:
        """Class scores are weights (3, 2) @ point + biases; the largest wins."""
        ...

    @property
    def biases(self) -> Floats:
        """(3,)."""
        ...

    def signed_distance(self, points: Floats) -> Floats:
        """Signed distance (S,) of points (S, 2) to the fall region, positive outside [sd]."""
        ...


class Box(NamedTuple):
    """A part of the plane [sd]."""

    low: Floats  # (2,)
    high: Floats  # (2,)


def around(plane: Plane, margin_sd: float) -> Box:
    """Return the box that holds the class centres with `margin_sd` on every side."""
    return Box(plane.centres.min(axis=0) - margin_sd, plane.centres.max(axis=0) + margin_sd)


def belongs(plane: Plane, horizon: FallHorizon) -> bool:
    """Whether the distances of a horizon are those of `plane`, so that its regions may be drawn with it."""
    distance = plane.signed_distance(horizon.plane)
    away = horizon.plane[:, None] - plane.centres
    centre_distance = np.hypot(away[..., 0], away[..., 1])
    return bool(
        np.allclose(distance, horizon.distance, rtol=0.0, atol=AGREEMENT_SD)
        and np.allclose(centre_distance, horizon.centre_distance, rtol=0.0, atol=AGREEMENT_SD)
    )


def region(plane: Plane, kind: int, box: Box) -> Floats:
    """Return the corners (N, 2) of the part of `box` where class `kind` wins, in order; N = 0 if it nowhere does."""
    (left, bottom), (right, top) = box
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    for other in range(len(CLASSES)):
        if other != kind:
            normal = plane.weights[kind] - plane.weights[other]
            corners = _cut(corners, normal, plane.biases[kind] - plane.biases[other])
    return corners


def fall_boundary(plane: Plane, box: Box) -> list[Floats]:
    """Return the sides (2, 2) of the fall region that are not sides of `box`."""
    corners = region(plane, _FALL, box)
    sides = [np.stack(pair) for pair in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return [side for side in sides if not _on_edge(side.mean(axis=0), box)]


def raster(plane: Plane, box: Box, size: int) -> NDArray[np.int64]:
    """Return the class that wins at each point of a grid over `box`: (size, size), rows along the second axis."""
    x, y = (np.linspace(low, high, size) for low, high in zip(box.low, box.high, strict=True))
    points = np.stack(np.meshgrid(x, y), axis=-1)  # (size, size, 2)
    classes: NDArray[np.int64] = (points @ plane.weights.T + plane.biases).argmax(axis=-1)
    return classes


def _cut(corners: Floats, normal: Floats, offset: float) -> Floats:
    """Keep the part of a polygon where normal @ point + offset >= 0 (Sutherland and Hodgman, 1974)."""
    kept: list[Floats] = []
    inside = corners @ normal + offset
    for index in range(len(corners)):
        here, there = inside[index - 1], inside[index]
        if (here < 0.0) != (there < 0.0):
            share = here / (here - there)
            kept.append(corners[index - 1] + share * (corners[index] - corners[index - 1]))
        if there >= 0.0:
            kept.append(corners[index])
    return np.array(kept).reshape(-1, 2)


def _on_edge(point: Floats, box: Box) -> bool:
    slack = 1e-9 * float((box.high - box.low).max())
    return bool((np.abs(point - box.low) <= slack).any() or (np.abs(point - box.high) <= slack).any())
