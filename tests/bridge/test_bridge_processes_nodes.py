"""The real nodes, launched by `surefoot up`, on a short walk that ends in a fall."""

from __future__ import annotations

import json
import os
import signal
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bridge_toys import PATIENCE_S, Stage, Up, wait_until
from numpy.typing import NDArray

from bridge.config.launch import DEFAULT_MODULES
from bridge.config.surefoot import SurefootConfig

REPO = Path(__file__).resolve().parents[2]
DEMO = REPO / "simulation" / "demo" / "walk-stumble-fall.npz"
CONFIG = SurefootConfig()
RESTING = {"SAFE_STOP", "DISARMED"}

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]  # several waits, each patient with a busy machine


@pytest.fixture
def stage(tmp_path: Path) -> Stage:
    stage = Stage(tmp_path)
    stage.write_config("stop_timeout_s = 10", modules=DEFAULT_MODULES)
    return stage


@pytest.fixture
def clip(tmp_path: Path) -> str:
    """Return the source: three seconds of walking, then the fall of the shipped recording."""
    with np.load(DEMO) as arrays:
        onset = int(np.argmax(arrays["walk-stumble-fall/label"] == 0))
    return write_clip(tmp_path, "fall", np.arange(onset - 90, onset + 50))


@pytest.fixture
def walk(tmp_path: Path) -> str:
    """Return the source: five minutes of walking, the shipped recording's beginning forward and backward again."""
    there = np.arange(150)
    return write_clip(tmp_path, "walk", np.tile(np.concatenate([there, there[-2:0:-1]]), 30))


def write_clip(folder: Path, name: str, frames: NDArray[np.int64]) -> str:
    with np.load(DEMO) as arrays:
        clip = {key: arrays[f"walk-stumble-fall/{key}"] for key in ("keypoints", "fps", "image_size")}
    clip["keypoints"] = clip["keypoints"][frames]
    np.savez(folder / f"{name}.npz", **{f"{name}/{key}": array for key, array in clip.items()})
    return f"{folder / name}.npz:{name}"


def test_mock_records_a_fall_seen_coming_and_the_safe_stop(stage: Stage, clip: str) -> None:
    log = stage.folder / "asked.jsonl"
    with Up(stage, "--source", clip, "--controller", "log", "--log", str(log)) as up:
        code, errors = up.end()
    assert (code, errors) == (0, "")
    assert stage.left() == []
    records = [json.loads(line) for line in log.read_text().splitlines()]
    check_order(records)
    asked = [record for record in records if record["call"] == "step"]
    assert {record["state"] for record in asked} >= {"FOLLOW", "ARREST"}
    assert max(record["stiffening"] for record in asked) > 0.8, "the fall was answered"
    assert min(record["stiffening"] for record in asked) < 0.1, "the walk was left free"
    for record in asked:
        assert record["state"] not in RESTING
        assert len(record["profile"]) == CONFIG.mpc.stages
        assert 0.0 <= min(record["profile"]) <= max(record["profile"]) <= 1.0
        age_s = (record["now_ns"] - record["rests_on_ns"]) * 1e-9
        assert age_s <= CONFIG.supervisor.horizon_age_limit_s, "never asked to act on an old frame"
    last = records[-1]
    assert (last["call"], last["state"]) == ("stop", "SAFE_STOP")
    assert "horizon" in last["reason"]


def check_order(records: list[dict[str, Any]]) -> None:
    for earlier, later in pairwise(records):
        assert earlier["now_ns"] < later["now_ns"]
    for earlier, later in pairwise(record for record in records if record["call"] == "step"):
        assert 0 < earlier["rests_on_ns"] <= later["rests_on_ns"]


def test_real_controller_moves_on_solved_problems_and_stops_when_blind(stage: Stage, walk: str) -> None:
    with Up(stage, "--source", walk, "--set", "launch.restart=false") as up:
        record = up.wait_for(
            lambda record: (
                record.get("command")
                and record["command"]["solver"] == "mpc"
                and record["command"]["velocity"][0] > 0.0
            )
        )
        os.kill(record["roles"]["perception"]["pid"], signal.SIGKILL)
        blind = up.wait_for(lambda record: record.get("command") and record["command"]["state"] == "SAFE_STOP")
        assert blind["command"]["solver"] == "stop"
        up.process.send_signal(signal.SIGINT)
        code, errors = up.end()
    assert code == 1, "perception was not started again"
    assert "perception was killed by signal 9" in errors
    assert stage.left() == []


def test_losing_the_anticipation_stops_the_walker_until_it_is_back(stage: Stage, walk: str) -> None:
    log = stage.folder / "asked.jsonl"
    with Up(stage, "--source", walk, "--controller", "log", "--log", str(log)) as up:
        record = up.wait_for(lambda record: record.get("command") and record["command"]["solver"] == "log")
        os.kill(record["roles"]["anticipation"]["pid"], signal.SIGKILL)
        wait_until(lambda: calls(log)[-1]["state"] == "SAFE_STOP", "safe stop", PATIENCE_S)
        up.wait_for(
            lambda record: (
                record.get("command")
                and record["roles"]["anticipation"]["restarts"] == 1
                and record["command"]["solver"] == "log"
            )
        )
        up.process.send_signal(signal.SIGINT)
        code, errors = up.end()
    assert (code, errors) == (0, "")
    assert stage.left() == []
    check_order(calls(log))


def calls(log: Path) -> list[dict[str, Any]]:
    """Return the complete lines of a log that is being written."""
    return [json.loads(line) for line in log.read_text().splitlines(keepends=True) if line.endswith("\n")]


def test_what_perception_refuses_is_one_line(stage: Stage, clip: str) -> None:
    with Up(stage, "--roles", "perception", "--source", clip.replace(":fall", ":flla")) as up:
        code, errors = up.end()
    assert code == 2
    assert errors.startswith("surefoot: perception: ")
    assert errors.count("\n") == 1
    assert "flla" in errors
    assert stage.left() == []
