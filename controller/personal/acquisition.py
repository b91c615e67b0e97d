"""Which setting to try next: where the surrogate is low, or where nobody has been.

GLISp's acquisition (Bemporad and Piga 2021, section 3.3): the next setting is the feasible u of least

    a(u) = f(u) / (max f - min f) - delta z(u),    z(u) = 2/pi atan(1 / sum_k 1 / |u - u_k|^2)

`z` is the inverse-distance weighting's measure of what is not known: 0 at what was tried, towards 1 far from it. The
range of f is that over the settings tried.
"""

from __future__ import annotations

import math

import numpy as np

from bridge.messages import Floats
from controller.personal.surrogate import Surrogate


def unknown(points: Floats, settings: Floats) -> Floats:
    """Return z (P,) of `points` (P, d), given the `settings` tried (N, d)."""
    apart = np.sum((points[:, None, :] - settings[None, :, :]) ** 2, axis=-1)
    with np.errstate(divide="ignore"):
        value: Floats = 2.0 / math.pi * np.arctan(1.0 / np.sum(1.0 / apart, axis=-1))
    return value


def best_point(surrogate: Surrogate, points: Floats, delta: float, apart: float) -> int:
    """Return which of `points` (P, d) is best tried next.

    Args:
        surrogate: fitted to what was tried.
        points: candidates, all feasible.
        delta: weight of what is not known; 0 asks for the lowest f.
        apart: least distance from every setting tried: what is nearer cannot be told from it. Where no candidate
            is that far away, the farthest one is returned.
    """
    tried = surrogate.settings
    distance = np.sqrt(np.min(np.sum((points[:, None, :] - tried[None, :, :]) ** 2, axis=-1), axis=1))
    far = distance >= apart
    if not far.any():
        return int(np.argmax(distance))
    f = surrogate(tried)
    span = max(float(f.max() - f.min()), 1e-9)  # all felt the same
    value = surrogate(points) / span - delta * unknown(points, tried)
    return int(np.argmin(np.where(far, value, np.inf)))
