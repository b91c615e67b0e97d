"""Networks for simulated people, unless the user names others."""

from __future__ import annotations

from bridge.config.load import load_config
from simulation.weights import SIMULATED, for_simulated_people


def test_simulated_people_are_judged_by_networks_that_know_them() -> None:
    assert for_simulated_people(load_config(None, [])).anticipation.checkpoint == SIMULATED


def test_who_names_networks_gets_them() -> None:
    named = load_config(None, ["anticipation.checkpoint=default"])
    assert for_simulated_people(named) == named
