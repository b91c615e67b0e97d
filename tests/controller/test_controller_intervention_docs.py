"""The tuning guide tells the truth about every threshold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "tuning.md"
ROW = re.compile(r"^\| `(\w+)` \| (-?[\d.]+)[^|]* \| (-?[\d.]+) \.\. (-?[\d.]+) \| (.+) \|$", re.MULTILINE)


def test_every_threshold_has_its_line_with_the_true_default_and_a_possible_range() -> None:
    rows = {key: numbers for key, *numbers, _ in ROW.findall(GUIDE.read_text())}
    fields = InterventionConfig.model_fields
    assert set(rows) == set(fields)
    for key, (default, low, high) in rows.items():
        assert float(default) == fields[key].default, key
        assert float(low) <= float(default) <= float(high), key
        for value in (float(low), float(high)):
            assert within_bounds(key, value), f"{key} = {value}"


def within_bounds(key: str, value: float) -> bool:
    """Whether the key may have this value, given a neighbour that fits."""
    try:
        InterventionConfig.model_validate({key: value})
    except ValidationError as error:
        return all("must be below" in problem["msg"] for problem in error.errors())
    return True


@pytest.mark.parametrize("key", SupervisorConfig.model_fields)
def test_every_state_threshold_says_what_it_does(key: str) -> None:
    assert SupervisorConfig.model_fields[key].description


def test_defaults_quoted_for_the_supervisor_are_true() -> None:
    text, config = GUIDE.read_text(), SupervisorConfig()
    assert f"| `guard_on` / `guard_off` | {config.guard_on:.2f} / {config.guard_off:.2f} |" in text
    assert f"| `arrest_on` / `arrest_off` | {config.arrest_on:g} / {config.arrest_off:g} |" in text
    assert f"| `harness_load_arrest_n` | {config.harness_load_arrest_n:g} N |" in text
    assert f"| `descent_arrest_m_s` | {config.descent_arrest_m_s:.2f} m/s |" in text
