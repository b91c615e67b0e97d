"""Clips for training: a fall as the camera saw it, when it showed, and a folder that goes on where it was."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from simulation.campaign.clips import command
from simulation.campaign.clips.job import ClipJob, drawn_help
from simulation.campaign.clips.record import NEVER, Help, History, record, visible_s
from simulation.campaign.clips.store import TOLD, Clips
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.disturbance import Push
from simulation.scenarios.scenario import Scenario, Wish

PUSHED_S = 2.5
FALL = Scenario(
    title="pushed over", kind="fall", family="push", size=BodySize(1.7, 75.0),
    wishes=(Wish(0.5, Intent(speed_m_s=0.5)),), disturbances=(Push(PUSHED_S, 130.0, 0.0),), duration_s=4.5, seed=3,
)  # fmt: skip
CONFIG = SurefootConfig()


@pytest.fixture(scope="module")
def unhelped() -> dict[str, np.ndarray]:
    return record(FALL, Help("none", 0), CONFIG, 1.0)


@pytest.fixture(scope="module")
def helped() -> dict[str, np.ndarray]:
    return record(FALL, Help("early", 16, 0.1), CONFIG, 1.0)


def test_a_push_shows_after_it_and_before_the_body_comes_down(unhelped: dict[str, np.ndarray]) -> None:
    time_s = np.arange(len(unhelped["drop_m"])) / float(unhelped["fps"])
    assert float(unhelped["disturbed_s"]) == pytest.approx(PUSHED_S, abs=0.01)
    shows_s = float(unhelped["visible_s"])
    assert PUSHED_S < shows_s < PUSHED_S + 0.3
    assert np.all(unhelped["drop_m"][time_s < shows_s] < 0.05)
    assert unhelped["drop_m"].max() > 0.1
    assert unhelped["keypoints"].shape == (len(time_s), 12, 3)
    assert np.isfinite(unhelped["keypoints"][..., :2]).all(axis=(1, 2)).mean() > 0.9


def test_until_the_disturbance_all_help_looks_the_same(
    unhelped: dict[str, np.ndarray], helped: dict[str, np.ndarray]
) -> None:
    before = round(PUSHED_S * 30)
    np.testing.assert_array_equal(unhelped["keypoints"][:before], helped["keypoints"][:before])
    assert helped["drop_m"].max() < unhelped["drop_m"].max()


def test_without_a_disturbance_nothing_shows() -> None:
    calm = replace(FALL, disturbances=())
    assert visible_s(History([], np.zeros(0), np.zeros((0, 12, 3)), np.zeros(0), np.zeros(0), [], NEVER, NEVER, 0.9),
                     calm) == NEVER  # fmt: skip


def test_help_is_a_matter_of_seed_and_number_alone() -> None:
    drawn = [drawn_help("fall", number, 5) for number in range(200)]
    assert drawn == [drawn_help("fall", number, 5) for number in range(200)]
    assert {each.name for each in drawn} == {"none", "reactive", "early"}
    assert {drawn_help("non_fall", number, 5).name for number in range(200)} == {"none", "reactive", "needless"}
    early = next(each for each in drawn if each.name == "early")
    assert not early.alarmed(early.alarm_s - 0.01)
    assert early.alarmed(early.alarm_s + 1.0)


def test_a_folder_takes_more_of_the_same_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def perform(job: ClipJob) -> dict[str, str]:
        job.path.write_bytes(b"")
        done.append(job.path.name)
        return {"name": job.path.name}

    monkeypatch.setattr(command, "perform_clip", perform)
    monkeypatch.setattr(command, "work", lambda performer, jobs, processes: map(performer, jobs))
    command.clips(falls=2, non_falls=1, seed=3, out=tmp_path)
    command.clips(falls=3, non_falls=1, seed=3, out=tmp_path)
    assert done == ["fall-0000.npz", "non_fall-0000.npz", "fall-0001.npz", "fall-0002.npz"]
    assert [json.loads(line)["name"] for line in (tmp_path / TOLD).read_text().splitlines()] == done
    with pytest.raises(SurefootError, match="seed"):
        Clips(tmp_path, {"seed": 4, "config": CONFIG.model_dump_json()})
