"""The controller is run with one setting after the other, as a process, and nothing is left running."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bridge.errors import SurefootError
from controller.personal.trial import Trial

STAND_IN = """
import os, pathlib, signal, sys, time
config = sys.argv[sys.argv.index("--config") + 1]
told = pathlib.Path("told.txt")
told.write_text(f"{os.getpid()} {'one' if 'ONE' in pathlib.Path(config).read_text() else 'two'}")
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
while True:
    time.sleep(0.02)
"""
CONFIG = """
version = 1
# {name}
[bridge]
namespace = "personal_trial"
endpoints = {{ perception = "", anticipation = "", drive = "", controller = "" }}
[launch]
modules = {{ controller = "./stand_in.py" }}
restart = false
"""


def until(what: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not what():
        assert time.monotonic() < end
        time.sleep(0.05)


def told() -> list[str]:
    return Path("told.txt").read_text().split() if Path("told.txt").exists() else []


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stand_in.py").write_text(STAND_IN)
    for name in ("one", "two"):
        Path(f"{name}.toml").write_text(CONFIG.format(name=name.upper()))


@pytest.mark.processes
def test_settings_follow_each_other_and_the_last_ends_with_the_context() -> None:
    with Trial(Path("controller.log")) as trial:
        trial.run(Path("one.toml"))
        Path("one.toml").write_text("rewritten for the next question")
        until(lambda: told()[1:] == ["one"])
        first = int(told()[0])
        trial.run(Path("two.toml"))
        assert not alive(first)
        until(lambda: told()[1:] == ["two"])
        second = int(told()[0])
    assert not alive(second)
    assert not Path("running.toml").exists()


@pytest.mark.processes
def test_a_controller_that_does_not_start_is_said_when_the_next_one_is_asked_for() -> None:
    Path("one.toml").write_text("[lunch]\n")
    with Trial(Path("controller.log")) as trial:
        trial.run(Path("one.toml"))
        until(lambda: "lunch" in Path("controller.log").read_text())
        until(lambda: trial.over)
        with pytest.raises(SurefootError, match="unknown key 'lunch'"):
            trial.run(Path("two.toml"))
