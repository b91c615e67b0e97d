"""How sure a count is: shares, rates, and what hours of recording can say about a budget."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan, sqrt
from typing import Final, NamedTuple

import numpy as np
from scipy.stats import chi2

from controller.tuning.score import Tally, total

Z: Final = 1.959964  # of a 95 % interval
RESAMPLES: Final = 2000


class Interval(NamedTuple):
    """A number with its 95 % confidence interval; NaN where there is nothing to count."""

    value: float
    low: float
    high: float


def wilson(hits: int, of: int) -> Interval:
    """Return the share of hits with E. B. Wilson's interval (JASA 22, 1927)."""
    if of == 0:
        return Interval(nan, nan, nan)
    p = hits / of
    centre = (p + Z**2 / (2 * of)) / (1 + Z**2 / of)
    half = Z / (1 + Z**2 / of) * sqrt(p * (1 - p) / of + Z**2 / (4 * of**2))
    return Interval(p, max(centre - half, 0.0), min(centre + half, 1.0))


def poisson(events: int, hours: float) -> Interval:
    """Return events per hour with the exact interval of a Poisson count (F. Garwood, Biometrika 28, 1936)."""
    if hours <= 0.0:
        return Interval(nan, nan, nan)
    low = chi2.ppf(0.025, 2 * events) / 2 if events else 0.0
    return Interval(events / hours, float(low) / hours, float(chi2.ppf(0.975, 2 * (events + 1))) / 2 / hours)


def rate_bound(events: int, hours: float) -> float:
    """Return the rate per hour that is not exceeded with 95 % confidence; 3 / hours without any event.

    That is the rule of three (J. A. Hanley, A. Lippman-Hand, JAMA 249, 1983), and its like for more events.
    """
    return float(chi2.ppf(0.95, 2 * (events + 1))) / 2 / hours if hours > 0.0 else inf


def hours_needed(events: int, budget_per_hour: float) -> float:
    """Return how many hours with so many events would show with 95 % confidence that the budget is kept."""
    return rate_bound(events, 1.0) / budget_per_hour


class Bootstrap(NamedTuple):
    """95 % intervals when the recordings themselves are drawn anew, whole recordings at a time."""

    caught_share: Interval
    lead_median_s: Interval
    per_hour: Interval


def bootstrap(tallies: Sequence[Tally], seed: int) -> Bootstrap:
    """Return the counts of `tallies` with intervals over recordings (percentile method)."""
    of: dict[str, list[Tally]] = {}
    for tally in tallies:
        of.setdefault(tally.group, []).append(tally)
    groups = [total(group) for group in of.values()]
    falls, caught, needless, hours = (
        np.array([getattr(group, name) for group in groups], dtype=np.float64)
        for name in ("falls", "caught", "needless", "hours")
    )
    whole = total(tallies)
    picks = np.random.default_rng(seed).integers(len(groups), size=(RESAMPLES, len(groups)))
    leads = [np.array(group.leads_s) for group in groups]
    medians = np.array([_median([leads[i] for i in pick]) for pick in picks])
    with np.errstate(invalid="ignore", divide="ignore"):
        shares, rates = caught[picks].sum(1) / falls[picks].sum(1), needless[picks].sum(1) / hours[picks].sum(1)
    return Bootstrap(
        _interval(whole.caught_share, shares), _interval(whole.lead_median_s, medians), _interval(whole.per_hour, rates)
    )


def _median(leads: Sequence[np.ndarray]) -> float:
    together = np.concatenate(leads)
    return float(np.median(together)) if len(together) else nan


def _interval(value: float, resampled: np.ndarray) -> Interval:
    known = resampled[np.isfinite(resampled)]
    if not len(known):
        return Interval(value, nan, nan)
    low, high = np.percentile(known, (2.5, 97.5))
    return Interval(value, float(low), float(high))
