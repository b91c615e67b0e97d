"""Where somebody falls: labels, lists, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from controller_tuning_streams import watched

from bridge.errors import SourceError
from controller.tuning.cases import OPEN, Fall
from controller.tuning.falls import labelled_falls, read_falls, with_falls

HEAD = "recording,onset_s,impact_s,over_s\n"


def labels(*spans: tuple[int, int]) -> tuple[Fall, ...]:
    label = np.concatenate([np.full(count, value) for value, count in spans])
    return labelled_falls(label, np.arange(len(label)) / 10.0)


def test_falling_then_lying_is_a_fall() -> None:
    assert labels((-1, 20), (0, 10), (1, 15)) == (Fall(2.0, 3.0, OPEN),)
    assert labels((-1, 20), (0, 10), (1, 15), (-1, 5), (0, 5), (1, 5)) == (Fall(2.0, 3.0, 4.5), Fall(5.0, 5.5, OPEN))


def test_lying_without_falling_before_has_an_onset_of_its_own() -> None:
    assert labels((-1, 20), (1, 10)) == (Fall(1.0, 2.0, OPEN),)
    assert labels((-1, 5), (1, 10)) == (Fall(0.0, 0.5, OPEN),)


def test_what_is_no_fall() -> None:
    assert labels((-1, 20)) == ()
    assert labels((-1, 20), (0, 5), (-1, 20)) == ()  # a stumble
    assert labels((1, 20), (-1, 20)) == ()  # lies from the beginning
    assert labels((0, 20)) == ()


def listed(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "falls.csv"
    path.write_text(text)
    return path


def test_a_list_of_falls(tmp_path: Path) -> None:
    path = listed(tmp_path, HEAD + "a.mcap,2,2.5,4\na.mcap,6,7,\n# a remark\n\nb,,3.5,\nc , , ,\n")
    assert read_falls(path) == {
        "a.mcap": [Fall(2.0, 2.5, 4.0), Fall(6.0, 7.0, OPEN)], "b": [Fall(2.5, 3.5, OPEN)], "c": [],
    }  # fmt: skip
    assert read_falls(listed(tmp_path, "recording,onset_s,impact_s\na,1,2\n")) == {"a": [Fall(1.0, 2.0, OPEN)]}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "first line"),
        ("name,begin,end\n", "first line is 'name,begin,end'"),
        (HEAD + "a,2,1,\n", r"line 2: expected onset_s < impact_s <= over_s, got 2, 1, inf"),
        (HEAD + "a,1,2,1.5\n", "line 2: expected onset_s"),
        (HEAD + "a,1,,\n", "line 2: impact_s is missing"),
        (HEAD + "a,x,2,\n", "line 2: onset_s = x: expected a number"),
        (HEAD + "a,-1,2,\n", "line 2: onset_s = -1"),
        (HEAD + "a,nan,2,\n", "line 2: onset_s = nan"),
        (HEAD + ",1,2,\n", "line 2: expected recording"),
        (HEAD + "a,1,2,3,4\n", "line 2: expected recording"),
    ],
)
def test_lists_that_make_no_sense(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(SourceError, match=said):
        read_falls(listed(tmp_path, text))


def test_a_list_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"no\.csv: cannot be read"):
        read_falls(tmp_path / "no.csv")


def test_a_list_overrides_what_is_known(tmp_path: Path) -> None:
    cases = [watched(6.0, (), (Fall(1.0, 2.0),), "clips.npz:walk"), watched(6.0, (), (Fall(1.0, 2.0),), "b.mcap")]
    told = with_falls(cases, {"walk": [Fall(3.0, 4.0)], "b.mcap": []}, tmp_path)
    assert [case.falls for case in told] == [(Fall(3.0, 4.0),), ()]


@pytest.mark.parametrize(
    ("name", "falls", "said"),
    [
        ("wlak", [Fall(1.0, 2.0)], "no recording 'wlak' was given; the nearest is 'walk'"),
        ("walk", [Fall(8.0, 9.0)], "impact at 9 s, the recording ends at 6.00 s"),
        ("walk", [Fall(1.0, 2.0), Fall(3.0, 4.0)], "before the one at 1 s is over; give its over_s"),
    ],
)
def test_falls_that_cannot_be(tmp_path: Path, name: str, falls: list[Fall], said: str) -> None:
    with pytest.raises(SourceError, match=said):
        with_falls([watched(6.0, (), (), "clips.npz:walk")], {name: falls}, tmp_path)
