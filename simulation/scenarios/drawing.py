"""Scenarios from seeds; what they claim to be is tried out without help before they count."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from bridge.errors import SurefootError
from simulation.scenarios.library import FAMILIES, draw_person
from simulation.scenarios.scenario import Kind, Scenario
from simulation.scenarios.unassisted import Course, unassisted

MOST_DRAWS: Final = 40


class Drawn(NamedTuple):
    """A scenario that is what it claims to be."""

    scenario: Scenario
    course: Course  # what becomes of it without help
    rejected: int  # draws before it that fell when they should not, or did not when they should


def draw(kind: Kind, number: int, seed: int, attempt: int = 0) -> Scenario:
    """Return the scenario `number` of a kind; families take turns. The same arguments give the same scenario."""
    families = FAMILIES[kind]
    rng = np.random.default_rng([seed, list(FAMILIES).index(kind), number, attempt])
    size, ability = draw_person(rng)
    return families[number % len(families)](rng, size, ability)


def draw_checked(kind: Kind, number: int, seed: int, first: int = 0) -> Drawn:
    """Return the first draw from `first` on that falls without help if it is a fall, and does not if it is none.

    Raises:
        SurefootError: none of many draws was what it claimed to be.
    """
    for attempt in range(first, MOST_DRAWS):
        scenario = draw(kind, number, seed, attempt)
        course = unassisted(scenario)
        if course.fell == (kind == "fall"):
            return Drawn(scenario, course, attempt)
    raise SurefootError(f"{kind} {number}, seed {seed}: {MOST_DRAWS} draws and none was a {kind.replace('_', '-')}")
