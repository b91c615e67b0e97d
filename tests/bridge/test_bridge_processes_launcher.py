"""The launcher by itself, with real processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from bridge_toys import Stage, wait_until

from bridge.config.load import load_config
from bridge.launch.launcher import Launcher, Phase

pytestmark = pytest.mark.processes


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stage:
    stage = Stage(tmp_path)
    for name in ("PYTHONPATH", "SUREFOOT_TEST"):
        monkeypatch.setenv(name, stage.environment()[name])
    return stage


def drive_only(stage: Stage, source: str, *overrides: str, logs: bool = True) -> Launcher:
    all_overrides = ('launch.roles=["drive"]', *overrides)
    config = load_config(stage.config, all_overrides)
    log_dir = stage.folder / "logs" if logs else None
    return Launcher(config, stage.config, all_overrides, {"drive": {"source": source}}, log_dir)


def reach(launcher: Launcher, phase: Phase) -> Callable[[], bool]:
    return lambda: launcher.poll()["drive"].phase is phase


def test_nothing_runs_before_start_and_after_stop(stage: Stage) -> None:
    with drive_only(stage, "") as launcher:
        before = launcher.poll()["drive"]
        assert (before.phase, before.pid, before.alive) == (Phase.WAITING, 0, False)
        launcher.start()
        running = launcher.poll()["drive"]
        assert running.alive
        assert os.getsid(running.pid) == running.pid, "a session of its own"
        launcher.start()
        assert launcher.poll()["drive"].pid == running.pid, "what runs is not started twice"
        launcher.stop()
        launcher.stop()
        after = launcher.poll()["drive"]
    assert (after.phase, after.alive, after.restarts) == (Phase.STOPPED, False, 0)
    assert stage.left() == []


def test_finished_is_not_restarted(stage: Stage) -> None:
    with drive_only(stage, "turns:2") as launcher:
        launcher.start()
        wait_until(reach(launcher, Phase.FINISHED), "finished")
        state = launcher.poll()["drive"]
    assert (state.exit_code, state.restarts, state.alive) == (0, 0, False)


def test_refusal_is_not_restarted_and_says_why(stage: Stage) -> None:
    with drive_only(stage, "missing:x.npz", logs=False) as launcher:
        launcher.start()
        wait_until(reach(launcher, Phase.REFUSED), "refused")
        state = launcher.poll()["drive"]
    assert (state.exit_code, state.restarts) == (2, 0)
    assert state.last_line == "surefoot drive: x.npz: no such source"


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("my_drvie", "surefoot launch.modules: no module 'my_drvie': install it, put its folder on PYTHONPATH"),
        ("lab/my_drive.py", "surefoot launch.modules: no such file: lab/my_drive.py"),
    ],
)
def test_a_node_that_is_not_there_is_named(stage: Stage, module: str, words: str) -> None:
    with drive_only(stage, "", f'launch.modules.drive="{module}"') as launcher:
        launcher.start()
        wait_until(reach(launcher, Phase.REFUSED), "refused")
        assert launcher.poll()["drive"].last_line.startswith(words)


def test_a_node_may_be_a_file_and_has_its_options_from_the_configuration(stage: Stage) -> None:
    file = stage.folder / "toy_drive.py"
    overrides = ('launch.roles=["drive"]', f'launch.modules.drive="{file}"', 'launch.options.drive.source="turns:2"')
    with Launcher(load_config(stage.config, overrides), stage.config, overrides) as launcher:
        launcher.start()
        wait_until(reach(launcher, Phase.FINISHED), "finished")


@pytest.mark.parametrize(("override", "restarts"), [("launch.restart=false", 0), ("launch.restart_limit=1", 1)])
def test_restarts_have_a_limit(stage: Stage, override: str, restarts: int) -> None:
    with drive_only(stage, "crash", override) as launcher:
        launcher.start()
        wait_until(reach(launcher, Phase.FAILED), "given up")
        state = launcher.poll()["drive"]
    assert (state.exit_code, state.restarts, state.last_line) == (3, restarts, "toy fell over")


@pytest.mark.parametrize("source", ["deaf", "litter"])
def test_neither_a_deaf_process_nor_its_children_survive(stage: Stage, source: str) -> None:
    with drive_only(stage, source, "launch.stop_timeout_s=0.3") as launcher:
        launcher.start()
        wait_until(lambda: port_is_open(stage.ports["drive"]), "the node is up")
        wait_until(lambda: len(stage.left()) == (2 if source == "litter" else 1), "its child is up")
    assert stage.left() == []


def test_children_of_a_process_that_died_die_with_it(stage: Stage) -> None:
    with drive_only(stage, "litter", "launch.restart=false") as launcher:
        launcher.start()
        wait_until(lambda: len(stage.left()) == 2, "its child is up")
        os.kill(launcher.poll()["drive"].pid, signal.SIGKILL)
        wait_until(reach(launcher, Phase.FAILED), "death seen")
        wait_until(lambda: not stage.left(), "its child gone")


def port_is_open(port: int) -> bool:
    listening = (line.split()[1:4:2] for line in Path("/proc/net/tcp").read_text().splitlines()[1:])
    return any(address.endswith(f":{port:04X}") and state == "0A" for address, state in listening)
