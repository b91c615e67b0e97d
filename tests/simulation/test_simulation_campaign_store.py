"""A campaign's folder says its format: the present one goes on, another is refused with what to do."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bridge.errors import SurefootError
from simulation.campaign.store import FORMAT, PLAN, Store

PLANNED = {"falls": 3, "seed": 1}


def test_a_folder_of_before_there_were_formats_goes_on(tmp_path: Path) -> None:
    (tmp_path / PLAN).write_text(json.dumps(PLANNED))
    Store(tmp_path, PLANNED)
    assert json.loads((tmp_path / PLAN).read_text()) == {"format": FORMAT, **PLANNED}
    Store(tmp_path, PLANNED)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (json.dumps({"format": FORMAT + 1, **PLANNED}), rf"format {FORMAT + 1}, .* reads and writes {FORMAT}"),
        (json.dumps({"format": "x"}), "format x"),
        ("[]", "format None"),
        ("{", "cannot be read"),
    ],
)
def test_other_formats_and_damage_are_refused_and_left(text: str, what: str, tmp_path: Path) -> None:
    (tmp_path / PLAN).write_text(text)
    with pytest.raises(SurefootError, match=what) as caught:
        Store(tmp_path, PLANNED)
    assert "name another folder with --out" in str(caught.value)
    assert (tmp_path / PLAN).read_text() == text
