"""`surefoot rehearse` with real processes: toy nodes on the real wire."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from bridge_toys import PATIENCE_S, ROLES, Stage

pytestmark = pytest.mark.processes


@pytest.fixture
def stage(tmp_path: Path) -> Stage:
    return Stage(tmp_path)


def start(stage: Stage, *arguments: str) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-m",
        "bridge.cli",
        "rehearse",
        "--config",
        str(stage.config),
        "--out",
        "out",
        *arguments,
    ]
    return subprocess.Popen(
        command, env=stage.environment(), cwd=stage.folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def modules(stage: Stage, **other: str) -> None:
    stage.write_config(modules={role: other.get(role, f"toy_{role}") for role in ROLES})


def test_it_ends_by_itself_and_leaves_picture_and_numbers(stage: Stage) -> None:
    shown, said = (process := start(stage, "--duration", "3", "--json", "-")).communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, said
    assert json.loads(shown)["onset_s"] > 0.0, "the result alone is on stdout"
    assert "FOLLOW" in said
    assert "timeline.png" in said.splitlines()[-1]
    assert sorted(path.name for path in (stage.folder / "out").iterdir()) == ["logs", "timeline.csv", "timeline.png"]
    with (stage.folder / "out" / "timeline.csv").open() as file:
        rows = list(csv.DictReader(file))
    stiffenings = {row["stiffening"] for row in rows}
    assert stiffenings - {"nan"} == {"0.25"}  # gaps where the toy controller was not there yet, never another value
    assert {row["fall"] for row in rows} == {"nan"}  # the toys forecast nothing
    assert stage.left() == []


def test_a_process_that_dies_is_named_in_one_line(stage: Stage) -> None:
    (stage.folder / "bad_drive.py").write_text("import os, sys\nprint('fell over', file=sys.stderr)\nos._exit(3)\n")
    modules(stage, drive="bad_drive")
    process = start(stage)
    shown, said = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, shown) == (2, "")
    assert said.splitlines()[-1] == "surefoot: drive died with exit code 3: fell over"
    assert stage.left() == []


def test_ctrl_c_stops_everything(stage: Stage) -> None:
    process = start(stage)
    assert process.stderr is not None
    while "FOLLOW" not in process.stderr.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert stage.left() == []
