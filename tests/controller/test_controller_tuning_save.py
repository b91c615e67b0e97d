"""Writing tuned values: the file stays its owner's."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from bridge.config.load import load_config
from bridge.config.template import render_template
from bridge.config.version import VERSION, migrated_text
from bridge.errors import ConfigError, SurefootError
from controller.tuning.save import tuned_text, write_toml

MINE = """\
# My walker, third floor.
[perception.source]  # the lens
fps_hz = 30.0

[intervention]
# how near
distance_onset_sd = 1.5  # she leans
rise_per_s = 8.0

[supervisor]
guard_on = 0.25
"""


def test_values_change_and_all_else_stays(tmp_path: Path) -> None:
    source, out = tmp_path / "mine.toml", tmp_path / "out.toml"
    source.write_text(MINE)
    write_toml(source, out, {"distance_onset_sd": 1.2, "probability_full": 0.7, "rise_per_s": 8.0}, note=["a", "b"])
    text = out.read_text()
    assert load_config(out).intervention == load_config(source).intervention.model_copy(
        update={"distance_onset_sd": 1.2, "probability_full": 0.7}
    )
    assert text.startswith("# tuned: a\n# tuned: b\n")
    assert "distance_onset_sd = 1.2  # was 1.5; she leans\n" in text
    was = f"{load_config(None).intervention.probability_full:g}, the default"
    assert f"probability_full = 0.7  # was {was}\n" in text
    lines = [line for line in MINE.splitlines() if "distance_onset_sd" not in line]
    assert [line for line in text.splitlines() if line in lines] == lines
    assert source.read_text() == MINE
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml", "out.toml"]


def test_tuned_again_it_says_what_was_before_and_no_more(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    for value in (1.2, 1.1):
        write_toml(file, file, {"distance_onset_sd": value}, note=[f"to {value}"], force=True)
    text = file.read_text()
    assert text.count("# tuned: ") == 1
    assert "distance_onset_sd = 1.1  # was 1.2; she leans\n" in text


def test_values_that_are_as_they_were_are_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    assert tuned_text(file, {"distance_onset_sd": 1.5, "release_per_s": 1.0}) == migrated_text(MINE, "mine")[0]


@pytest.mark.parametrize(
    "text",
    ["", "intervention.rise_per_s = 8.0\n", "[bridge]\nnamespace = 'a'\n", "intervention = { rise_per_s = 9.0 }\n"],
)
def test_any_way_of_writing_the_section(tmp_path: Path, text: str) -> None:
    file = tmp_path / "c.toml"
    file.write_text(text)
    before, tuned = tomllib.loads(text), tomllib.loads(tuned_text(file, {"distance_onset_sd": 2.0}))
    assert tuned["intervention"]["distance_onset_sd"] == 2.0
    before.setdefault("intervention", {})["distance_onset_sd"] = 2.0
    assert tuned == {**before, "version": VERSION}


def test_the_whole_template(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_text(render_template())
    new, old = tuned_text(file, {"steps_used": 15}).splitlines(), render_template().splitlines()
    assert [(a, b) for a, b in zip(old, new, strict=True) if a != b] == [
        ("steps_used = 16", "steps_used = 15  # was 16")
    ]


def test_without_a_file_there_is_the_section_alone() -> None:
    expected = {"version": VERSION, "intervention": {"distance_onset_sd": 2.0}}
    assert tomllib.loads(tuned_text(None, {"distance_onset_sd": 2.0})) == expected


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    with pytest.raises(SurefootError, match="--force"):
        write_toml(file, file, {"distance_onset_sd": 1.0})
    assert file.read_text() == MINE


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"distance_onset_sd": -3.0}, "distance_full_sd = -0.5 must be below distance_onset_sd = -3"),
        ({"distance_onset_sd": 99.0}, "distance_onset_sd"),
        ({"distance": 1.0}, "unknown key 'intervention.distance'"),
    ],
)
def test_what_does_not_hold_together_is_refused_and_nothing_written(
    tmp_path: Path, changes: dict[str, float], said: str
) -> None:
    file, out = tmp_path / "mine.toml", tmp_path / "out.toml"
    file.write_text(MINE)
    with pytest.raises(ConfigError, match=said):
        write_toml(file, out, changes)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


@pytest.mark.parametrize("text", ["[intervention\n", "[intervention]\nrise = 1\n", None])
def test_a_file_that_is_wrong_already(tmp_path: Path, text: str | None) -> None:
    file = tmp_path / "mine.toml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ConfigError, match=r"mine\.toml"):
        tuned_text(file, {"rise_per_s": 9.0})
