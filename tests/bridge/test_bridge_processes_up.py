"""`surefoot up` with real processes: toy nodes on the real wire."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from bridge_toys import PATIENCE_S, ROLES, Stage, Up, all_alive, listening, wait_until

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]  # several waits, each patient with a busy machine
PAIR = ("--roles", "perception,controller")


@pytest.fixture
def stage(tmp_path: Path) -> Stage:
    return Stage(tmp_path)


def test_killed_process_is_restarted_and_ctrl_c_leaves_nothing(stage: Stage) -> None:
    with Up(stage) as up:
        record = up.wait_for(all_alive())
        assert set(record["roles"]) == set(ROLES)
        victim = record["roles"]["anticipation"]["pid"]
        os.kill(victim, signal.SIGKILL)
        again = up.wait_for(lambda record: all_alive()(record) and record["roles"]["anticipation"]["restarts"] == 1)
        assert again["roles"]["anticipation"]["pid"] != victim
        assert again["roles"]["drive"]["pid"] == record["roles"]["drive"]["pid"]
        shown = up.wait_for(lambda record: record.get("command") and record["command"]["state"] == "FOLLOW")
        assert shown["command"]["stiffening"] == pytest.approx(0.25)
        assert shown["roles"]["controller"]["values"]["rate_hz"] == "50.0"
        up.process.send_signal(signal.SIGINT)
        code, errors = up.end()
    assert (code, errors) == (0, "")
    assert stage.left() == []


def test_end_of_the_source_ends_everything_after_the_safe_stop(stage: Stage) -> None:
    with Up(stage, "--source", "turns:60", *PAIR) as up:
        code, errors = up.end()
    assert (code, errors) == (0, "")
    states = [record["command"]["state"] for record in up.seen if record.get("command")]
    assert states[-1] == "SAFE_STOP"
    assert any("SAFE_STOP" in event for event in up.events)
    assert up.seen[-1]["roles"]["perception"]["phase"] == "finished"
    assert up.seen[-1]["roles"]["perception"]["restarts"] == 0
    assert stage.left() == []


def test_refused_input_is_passed_on_in_one_line(stage: Stage) -> None:
    with Up(stage, "--source", "missing:clip.npz", *PAIR) as up:
        code, errors = up.end()
    assert code == 2
    assert errors == "surefoot: perception: clip.npz: no such source\n"
    assert stage.left() == []


def test_killing_up_takes_its_processes_along(stage: Stage) -> None:
    with Up(stage, *PAIR) as up:
        up.wait_for(all_alive(("perception", "controller")))
        up.process.kill()
        code, _ = up.end()
        assert code == -signal.SIGKILL
        wait_until(lambda: not stage.left(), "every process gone", patience_s=2.0)


def test_role_that_keeps_dying_is_given_up(stage: Stage) -> None:
    stage.write_config("restart_limit = 1")
    with Up(stage, "--source", "crash", *PAIR) as up:
        record = up.wait_for(lambda record: record.get("roles", {}).get("perception", {}).get("phase") == "failed")
        assert record["roles"]["perception"]["restarts"] == 1
        assert record["roles"]["controller"]["phase"] == "running"
        up.process.send_signal(signal.SIGTERM)
        code, errors = up.end()
    assert code == 1
    assert errors.count("\n") == 1
    assert "perception" in errors
    assert "exit code 3" in errors
    assert "perception.log" in errors
    assert stage.left() == []


def test_plain_lines_and_duration(stage: Stage) -> None:
    command = [sys.executable, "-m", "bridge.cli", "up", "--config", str(stage.config), "--roles", "drive"]
    done = subprocess.run(
        [*command, "--duration", "2"],
        env=stage.environment(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "drive" in done.stdout
    assert "anticipation" not in done.stdout
    assert "as asked" in done.stdout
    assert stage.left() == []


def test_port_in_use_is_named_before_anything_starts(stage: Stage) -> None:
    port = stage.ports["controller"]
    with listening(port), Up(stage) as up:
        code, errors = up.end()
    assert code == 2
    assert errors.count("\n") == 1
    assert "controller" in errors
    assert str(port) in errors
    assert not (stage.folder / "logs").exists()
    assert stage.left() == []
