"""The logging controller: what it records, that the record is bounded and readable while it runs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_messages import MS, NS, odometry, wrench

from bridge.errors import ConfigError
from bridge.messages import GaitState
from controller.interface import Decision
from controller.mock import LoggingController


def decision(**changes: Any) -> Decision:
    values = {
        "state": GaitState.GUARD,
        "reason": "fall boundary 0.4 sd away",
        "stiffening": 0.4,
        "profile": np.linspace(0.4, 0.9, 20),
        "fall_distance": 0.4,
        "fall_probability": 0.7,
        "rests_on_ns": 5,
    }
    return Decision(**(values | changes))


def test_answers_passively() -> None:
    mock = LoggingController()
    out = mock.step(NS, odometry(height=0.93), wrench(force=(50, 0, -100)), decision())
    out.check()
    assert not out.velocity.any()
    assert out.column_height == 0.93
    assert (out.state, out.reason, out.stiffening) == (GaitState.GUARD, "fall boundary 0.4 sd away", 0.4)
    assert (out.fall_distance, out.fall_probability, out.rests_on_ns) == (0.4, 0.7, 5)
    assert out.stamp_ns == NS


def test_holds_the_column_where_it_was_found_until_reset() -> None:
    mock = LoggingController()
    mock.step(NS, odometry(height=0.93), wrench(), decision())
    assert mock.step(NS, odometry(height=0.90), wrench(), decision()).column_height == 0.93
    mock.reset()
    assert mock.step(NS, odometry(height=0.90), wrench(), decision()).column_height == 0.90


def test_log_is_readable_while_it_runs(tmp_path: Path) -> None:
    file = tmp_path / "calls.jsonl"
    mock = LoggingController(str(file))
    mock.step(NS, odometry(), wrench(force=(1, 2, 3)), decision())
    mock.stop(NS + MS, decision(state=GaitState.SAFE_STOP, fall_distance=math.nan, fall_probability=math.nan))
    first, second = [json.loads(line) for line in file.read_text().splitlines()]
    assert first["call"] == "step"
    assert first["state"] == "GUARD"
    assert first["reason"] == "fall boundary 0.4 sd away"
    assert (first["stiffening"], first["fall_distance"], first["fall_probability"]) == (0.4, 0.4, 0.7)
    assert len(first["profile"]) == 20
    assert first["force"] == [1, 2, 3]
    assert (second["call"], second["state"], second["fall_distance"]) == ("stop", "SAFE_STOP", None)
    mock.close()
    mock.close()


def test_memory_is_bounded() -> None:
    mock = LoggingController(max_records=10)
    for k in range(25):
        mock.step(NS + k, odometry(), wrench(), decision())
    assert [r["now_ns"] - NS for r in mock.records] == list(range(15, 25))


def test_file_is_bounded(tmp_path: Path) -> None:
    file = tmp_path / "calls.jsonl"
    mock = LoggingController(str(file), max_records=10)
    for k in range(25):
        mock.step(NS + k, odometry(), wrench(), decision())
    mock.close()
    numbers = [json.loads(line)["now_ns"] - NS for line in file.read_text().splitlines()]
    older = [json.loads(line)["now_ns"] - NS for line in (tmp_path / "calls.jsonl.1").read_text().splitlines()]
    assert older + numbers == list(range(10, 25))
    assert len(list(tmp_path.iterdir())) == 2


def test_log_of_the_run_before_is_kept(tmp_path: Path) -> None:
    """A controller that was killed and started again does not wipe what led to it."""
    file = tmp_path / "calls.jsonl"
    for k in range(2):
        mock = LoggingController(str(file))
        mock.step(NS + k, odometry(), wrench(), decision())
        mock.close()
    assert json.loads(file.read_text())["now_ns"] == NS + 1
    assert json.loads((tmp_path / "calls.jsonl.1").read_text())["now_ns"] == NS


def test_file_that_cannot_be_written_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"controller.log = .*nowhere.*: cannot be written: No such file"):
        LoggingController(str(tmp_path / "nowhere" / "calls.jsonl"))


def test_full_disk_does_not_stop_the_loop(tmp_path: Path) -> None:
    mock = LoggingController(str(tmp_path / "calls.jsonl"))

    class FullDisk:
        def write(self, _text: str) -> None:
            raise OSError(28, "No space left on device")

        def close(self) -> None:
            raise OSError(28, "No space left on device")

    mock.close()
    mock._file = FullDisk()  # type: ignore[assignment]
    mock.step(NS, odometry(), wrench(), decision())
    mock.step(NS + 1, odometry(), wrench(), decision())
    assert "no longer written: No space left on device" in mock.fault
    assert len(mock.records) == 2
