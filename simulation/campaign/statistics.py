"""Confidence intervals: of shares, and of medians and percentiles."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, sqrt
from typing import Final, NamedTuple

import numpy as np

Z: Final = 1.959964  # of a 95 % interval
RESAMPLES: Final = 2000


class Estimate(NamedTuple):
    """A number with its 95 % confidence interval; NaN where there is nothing to count."""

    value: float
    low: float
    high: float


def share(hits: int, of: int) -> Estimate:
    """Return the share of hits with E. B. Wilson's interval (JASA 22, 1927)."""
    if of == 0:
        return Estimate(nan, nan, nan)
    p = hits / of
    centre = (p + Z**2 / (2 * of)) / (1 + Z**2 / of)
    half = Z / (1 + Z**2 / of) * sqrt(p * (1 - p) / of + Z**2 / (4 * of**2))
    return Estimate(p, max(centre - half, 0.0), min(centre + half, 1.0))


def percentile(values: Sequence[float], which: float) -> Estimate:
    """Return a percentile of the finite values with its bootstrap interval (percentile method, seed 0)."""
    finite = np.array([value for value in values if np.isfinite(value)])
    if not len(finite):
        return Estimate(nan, nan, nan)
    picks = np.random.default_rng(0).integers(len(finite), size=(RESAMPLES, len(finite)))
    low, high = np.percentile(np.percentile(finite[picks], which, axis=1), (2.5, 97.5))
    return Estimate(float(np.percentile(finite, which)), float(low), float(high))
