"""Choosing a setting for a budget of needless interventions, and the settings among which there is no better one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite
from typing import Final, NamedTuple

from bridge.errors import ConfigError
from controller.tuning.score import Outcome

FRAME_S: Final = 1.0 / 30.0  # leads that differ by less are the same

_BUDGET: Final = re.compile(r"\s*(?P<events>\d+(?:\.\d+)?)\s*(?:in|per|/)\s*(?P<hours>\d+(?:\.\d+)?)?\s*h(?:ours?)?\s*")


class Chosen(NamedTuple):
    """A choice among settings."""

    number: int  # among the settings
    within: bool  # whether it keeps the budget on what it was chosen on


def parse_budget(text: str) -> float:
    """Return needless interventions per hour: '1 in 10 h' is 0.1, a bare number is itself.

    Raises:
        ConfigError: it is neither, or not positive.
    """
    match = _BUDGET.fullmatch(text)
    try:
        budget = float(match["events"]) / float(match["hours"] or 1.0) if match else float(text)
    except (ValueError, ZeroDivisionError):
        budget = -1.0
    if not (isfinite(budget) and budget > 0.0):
        raise ConfigError(f"--budget {text}: expected such as '1 in 10 h', or a number above 0 per hour")
    return budget


def choose(outcomes: Sequence[Outcome], budget_per_hour: float, change: Sequence[float]) -> Chosen:
    """Return the best of `outcomes` that keeps the budget; if none does, the one with fewest needless interventions.

    Best is, in this order: more falls caught, a longer median lead (in whole frames), fewer needless interventions, and
    a setting nearer to the present one (`change`).
    """
    within = [i for i, one in enumerate(outcomes) if one.needless <= budget_per_hour * one.hours]
    if within:
        return Chosen(min(within, key=lambda i: (*_merit(outcomes[i]), outcomes[i].needless, change[i], i)), True)
    every = range(len(outcomes))
    return Chosen(min(every, key=lambda i: (outcomes[i].needless, *_merit(outcomes[i]), change[i], i)), False)


def as_good(one: Outcome, other: Outcome) -> bool:
    """Return whether `one` is no worse than `other` in falls, lead (in whole frames) and needless interventions."""
    return one.needless <= other.needless and all(a <= b for a, b in zip(_merit(one), _merit(other), strict=True))


def pareto(outcomes: Sequence[Outcome], change: Sequence[float]) -> list[int]:
    """Return which outcomes no other one beats in falls caught, median lead and needless interventions at once.

    Of equal ones the setting nearest to the present one stands for all. Fewest needless first.
    """
    best: dict[tuple[float, ...], int] = {}
    for i, one in enumerate(outcomes):
        point = (one.needless, *_merit(one))
        if point not in best or change[i] < change[best[point]]:
            best[point] = i
    points = sorted(best)
    return [
        best[point]
        for point in points
        if not any(other != point and all(a <= b for a, b in zip(other, point, strict=True)) for other in points)
    ]


def _merit(one: Outcome) -> tuple[float, float]:
    """Return what is better the smaller it is."""
    lead = one.lead_median_s
    return -one.caught, -round(lead / FRAME_S) if isfinite(lead) else 0.0
