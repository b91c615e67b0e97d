"""What must hold in a trial, by the names that scenarios carry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from simulation.campaign.measures import Measures
from simulation.scenarios.scenario import Scenario

CHECKS: Final[dict[str, Callable[[Measures], bool]]] = {
    "arrested": lambda m: m.arrested_fall,
    "upright walker": lambda m: not m.tipped,
    "no needless arrest": lambda m: m.arrests == 0,
    "on their feet": lambda m: not m.touched,
}


def failed(scenario: Scenario, measures: Measures) -> list[str]:
    """Return the names of the scenario's checks that do not hold."""
    return [name for name in scenario.checks if not CHECKS[name](measures)]
