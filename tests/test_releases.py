"""What earlier releases left behind is still read: one configuration, one checkpoint, one recording of each."""

from __future__ import annotations

import json
import logging
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from anticipation.checkpoint import load
from anticipation.plane_file import read_plane
from bridge.cli import main
from bridge.codec import decode
from bridge.config.load import load_config
from bridge.config.version import VERSION, migrated
from bridge.record.info import summarise
from bridge.record.offline import replay_offline
from bridge.record.reader import Recording
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND, Topic
from bridge.transport.interface import Sample

RELEASES = sorted(path for path in (Path(__file__).parent / "fixtures").iterdir() if path.is_dir())
SAME = {"rtol": 1e-4, "atol": 1e-4}  # docs/compatibility.md promises it


@pytest.fixture(params=RELEASES, ids=lambda path: path.name)
def release(request: pytest.FixtureRequest) -> Path:
    folder: Path = request.param
    return folder


def values(table: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from values(value, (*path, key))
        else:
            yield (*path, key), value


def answers(release: Path, role: str) -> list[tuple[Topic, Sample]]:
    """Return what `role` of today makes of the recording, with the checkpoint of then."""
    kept: list[tuple[Topic, Sample]] = []
    config = load_config(None, [f"anticipation.checkpoint={release / 'checkpoint.safetensors'}"])
    replay_offline(Recording(release / "recording.mcap"), [role], config, {}, lambda *answer: kept.append(answer))
    return kept


def test_there_are_releases() -> None:
    assert RELEASES


@pytest.mark.parametrize("name", ["surefoot.toml", "walker.toml"])
def test_a_configuration_says_what_it_said(release: Path, name: str) -> None:
    file = release / name
    loaded = load_config(file).model_dump(mode="json")
    table, _ = migrated(tomllib.loads(file.read_text(encoding="utf-8")), name)
    for path, value in values(table):
        found: Any = loaded
        for key in path:
            found = found[key]
        assert found == value, f"{'.'.join(path)} of {file}"


def test_a_configuration_without_version_is_read_with_a_hint_that_works(
    release: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "walker.toml"
    file.write_bytes((release / "walker.toml").read_bytes())
    with caplog.at_level(logging.WARNING, "surefoot.config"):
        before = load_config(file)
        load_config(file)
    (hint,) = [record.getMessage() for record in caplog.records if record.name == "surefoot.config"]
    assert main(hint.partition("surefoot config")[2].join(["config", ""]).split()) == 0
    assert load_config(file) == before
    text = file.read_text(encoding="utf-8")
    assert tomllib.loads(text)["version"] == VERSION
    assert "# Made calmer after the trials in May." in text
    assert "chassis_mass_kg = 92.0  # weighed" in text
    caplog.clear()
    load_config(file)
    assert not caplog.records, "no hint any more"


def test_a_checkpoint_gives_the_same_numbers(release: Path) -> None:
    expected = np.load(release / "expected.npz")
    checkpoint = load(release / "checkpoint.safetensors")
    window = torch.tensor(expected["window"], dtype=torch.float32)
    with torch.inference_mode():
        np.testing.assert_allclose(checkpoint.logits(window), expected["logits"], **SAME)
        np.testing.assert_allclose(checkpoint.forecast(window), expected["forecast"], **SAME)
    for plane in (checkpoint.plane, read_plane(str(release / "checkpoint.safetensors"))):
        for name, array in plane.arrays().items():
            np.testing.assert_allclose(array, expected[f"plane/{name}"], rtol=1e-6)


def test_a_recording_holds_what_it_held(release: Path) -> None:
    expected = json.loads((release / "expected.json").read_text())
    recording = Recording(release / "recording.mcap")
    found = summarise(recording)
    assert {topic.topic: topic.messages for topic in found.topics} == expected["messages"]
    assert found.duration_s == pytest.approx(expected["duration_s"])
    assert found.damage == ""
    assert found.foreign == {}
    for _, message, arrival_ns in recording.messages():
        if getattr(message, "valid", True):
            message.check()
        assert arrival_ns > 0
    assert recording.undecodable == 0


def test_anticipation_foresees_the_same_from_it(release: Path) -> None:
    recording = Recording(release / "recording.mcap")
    then = [message for _, message, _ in recording.messages([FALL_HORIZON])]
    now = [decode(topic, sample.payload) for topic, sample in answers(release, "anticipation") if topic == FALL_HORIZON]
    assert [message.stamp_ns for message in now] == [message.stamp_ns for message in then]
    assert sum(message.valid for message in now) > 30
    for old, new in zip(then, now, strict=True):
        assert new.valid == old.valid
        for name in ("probabilities", "distance", "plane", "forecast_px", "quality"):
            np.testing.assert_allclose(getattr(new, name), getattr(old, name), rtol=1e-3, atol=1e-3, err_msg=name)


def test_the_controller_takes_it_as_input(release: Path) -> None:
    """What it commands may differ from release to release; that it follows a walk without a stop may not."""
    commands = [decode(topic, s.payload) for topic, s in answers(release, "controller") if topic == SUPPORT_COMMAND]
    for command in commands:
        command.check()
    assert len(commands) > 200
    assert sum(command.valid for command in commands) > 100
