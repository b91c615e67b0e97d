"""Masses, sizes and limits: each says its unit, and where it comes from or that it is assumed."""

from __future__ import annotations

import re

import pytest
from pydantic import BaseModel

from bridge.config.admittance import AdmittanceConfig
from bridge.config.gate import GateConfig
from bridge.config.load import load_config
from bridge.config.walker import WalkerConfig
from bridge.errors import ConfigError

UNIT = re.compile(
    r"\[(kg|m|kg m\^2|m/s\^2|m/s|m/s\^3|rad/s|rad/s\^2|rad/s\^3|N|N m|N/m|N s/m|N m s/rad|N m/rad|rad|J|s)\]"
)
PLAIN = {"wheel_gear_ratio", "friction_coefficient", "tank_refill_fraction", "excess_fraction"}  # numbers without one
SOURCE = re.compile(r"assumed|WANDER|100 kg caught at|Gravity")


@pytest.mark.parametrize(("section", "key"), [(c, k) for c in (WalkerConfig, AdmittanceConfig) for k in c.model_fields])
def test_says_its_unit(section: type[BaseModel], key: str) -> None:
    said = section.model_fields[key].description or ""
    assert key in PLAIN or UNIT.search(said), f"{key}: {said}"


@pytest.mark.parametrize("key", WalkerConfig.model_fields)
def test_says_its_source_or_that_it_is_assumed(key: str) -> None:
    assert SOURCE.search(WalkerConfig.model_fields[key].description or ""), key


def test_the_rendered_admittance_is_said_to_be_assumed() -> None:
    assert "All values are assumed" in (AdmittanceConfig.__doc__ or "")


@pytest.mark.parametrize("section", [WalkerConfig, AdmittanceConfig, GateConfig])
def test_every_number_has_bounds(section: type[BaseModel]) -> None:
    for key, field in section.model_fields.items():
        if field.annotation is float:
            kinds = {type(bound).__name__ for bound in field.metadata}
            assert kinds & {"Gt", "Ge"}, key
            assert kinds & {"Lt", "Le"}, key


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("walker.chassis_mass_kg=-1", "walker.chassis_mass_kg = -1.*greater than 0"),
        ("walker.wheel_radius_m=0.7", "walker.wheel_radius_m = 0.7.*less than or equal to 0.5"),
        ("admittance.mass_horizontal_kg=nan", "admittance.mass_horizontal_kg"),
        ("gate.lifetime_s=1", "gate.lifetime_s = 1.*less than or equal to 0.09"),
        ("controller.realtime_priority=99", "controller.realtime_priority = 99.*less than or equal to 80"),
        ("intervention.probability_onset=2", "intervention.probability_onset = 2.*less than or equal to 1"),
    ],
)
def test_an_error_names_key_value_and_range(setting: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config(None, [setting])
