"""The alarm: calls when a fall is foreseen, when it is there, and when nothing is known any more."""

from __future__ import annotations

import logging
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from examples_running import REPO, Running

from bridge.clock import NS, ManualClock
from bridge.config.load import load_config
from bridge.errors import ConfigError
from bridge.messages import STEPS, FallHorizon
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.plugin import load_module
from bridge.topics import FALL_HORIZON
from bridge.transport.memory import MemoryHub

FILE = "examples/alarm.py"
NOTE = "import sys; print(*sys.argv[2:], file=open(sys.argv[1], 'a'))"


def horizon(stamp_ns: int, falls_at: int | None, valid: bool = True) -> FallHorizon:
    """Stable up to step `falls_at`, a fall from there on; the last digits differ, as those of live numbers do."""
    first = STEPS if falls_at is None else falls_at
    noise = 1e-6 * ((stamp_ns // 1000) % 997)
    fall = np.where(np.arange(STEPS) >= first, 0.96, 0.01) + noise
    distance = np.where(np.arange(STEPS) >= first, -1.0, 6.0) + noise
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=np.column_stack((0.99 - fall, np.full(STEPS, 0.01), fall)),
        distance=distance,
        distance_rate=np.gradient(distance, 1 / 30),
        time_to_boundary=np.full(STEPS, np.inf),
        centre_distance=np.zeros((STEPS, 3)),
        plane=np.zeros((STEPS, 2)),
        forecast_px=np.zeros((STEPS, 12, 2)),
        quality=1.0,
        valid=valid,
        reason="" if valid else "nobody in view",
    )


class Bench:
    """The alarm on an in-memory wire, with time moved by hand."""

    def __init__(self, *overrides: str, **options: str) -> None:
        self.clock = ManualClock(NS)
        hub = MemoryHub(self.clock)
        config = load_config(None, overrides)
        context = NodeContext(config, hub.transport(), self.clock, logging.getLogger("test"), options)
        self.node = load_module(str(REPO / FILE)).create(context)
        self.horizons = Outbox(hub.transport(), FALL_HORIZON)

    def run(self, seconds: float, falls_at: int | None = None, *, see: bool = True, valid: bool = True) -> None:
        for _ in range(round(seconds * 30)):
            self.clock.advance(1 / 30)
            now_ns = self.clock.now_ns()
            if see:
                self.horizons.send(horizon(now_ns, falls_at, valid))
            self.node.step(now_ns)


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().out.splitlines()


def test_calls_early_again_when_it_is_there_and_when_all_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    bench = Bench()
    bench.run(1.0)
    assert [line.split(":")[0] for line in lines(capsys)] == ["all well"]
    bench.run(0.3, falls_at=14)
    (early,) = lines(capsys)
    assert early.startswith("\aa fall may come: ")
    assert "foreseen in" in early
    bench.run(0.3, falls_at=0)
    assert [line.split(":")[0] for line in lines(capsys)] == ["\aFALL"]
    bench.run(2.0, falls_at=0)
    assert lines(capsys) == [], "no call twice"
    bench.run(4.0)
    assert {line.split(":")[0] for line in lines(capsys)} == {"all well"}
    assert bench.node.status(bench.clock.now_ns()).level == 0


@pytest.mark.parametrize(("see", "words"), [(False, "fall_horizon is"), (True, "nobody in view")])
def test_says_that_it_is_not_watching(capsys: pytest.CaptureFixture[str], see: bool, words: str) -> None:
    bench = Bench()
    assert bench.node.status(NS).summary == "waiting: waiting for a horizon"
    bench.run(1.0)
    lines(capsys)
    bench.run(0.4, see=see, valid=False)
    (blind,) = lines(capsys)
    assert blind.startswith("\anot watching: ")
    assert words in blind
    assert bench.node.status(bench.clock.now_ns()).level == 2


def test_runs_a_command_but_not_all_the_time(tmp_path: Path) -> None:
    note = tmp_path / "called.txt"
    bench = Bench(command=f"{sys.executable} -c \"{NOTE}\" '{note}'", every_s="3")
    bench.run(1.0)
    for _ in range(2):
        bench.run(0.3, falls_at=14)
        bench.run(0.8)
    end_s = time.monotonic() + 30.0
    while not note.is_file() or not note.read_text().endswith("\n"):
        assert time.monotonic() < end_s
        time.sleep(0.01)
    for process in bench.node._running:
        process.wait(30.0)
    (called,) = note.read_text().splitlines()
    assert called.startswith("GUARD ")


def test_a_command_that_does_not_run_is_said_and_the_watch_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    bench = Bench(command="no-such-siren")
    bench.run(1.0)
    bench.run(0.3, falls_at=14)
    said = capsys.readouterr()
    assert "a fall may come" in said.out
    assert said.err == "alarm: no-such-siren does not run: No such file or directory\n"


@pytest.mark.parametrize(
    ("overrides", "options", "words"),
    [
        ((), {"comand": "beep"}, "alarm option comand: known: command, every_s"),
        ((), {"every_s": "often"}, "could not convert string to float"),
        (("intervention.steps_used=0",), {}, "steps_used = 0: nobody would ever be called"),
    ],
)
def test_an_alarm_that_would_not_work_is_refused(
    overrides: tuple[str, ...], options: dict[str, str], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Bench(*overrides, **options)


@pytest.mark.processes
def test_surefoot_up_runs_it(tmp_path: Path) -> None:
    note = tmp_path / "called.txt"
    script = tmp_path / "siren.py"
    script.write_text(NOTE)
    options = (
        *("--set", f"launch.modules.alarm={FILE}"),
        *("--set", f"launch.options.alarm.command={sys.executable} {script} {note}"),
    )
    with Running(tmp_path, "alarm", "anticipation", *options) as running:
        horizons = Outbox(running.wire, FALL_HORIZON)

        def sees(now_ns: int, falls_at: int | None) -> bool:
            horizons.send(horizon(now_ns, falls_at))
            time.sleep(0.02)
            return note.is_file() and "GUARD " in note.read_text()

        running.until(lambda now_ns: sees(now_ns, None) or "watching" in running.summary("alarm"), "it watches")
        assert not note.is_file()
        running.until(lambda now_ns: sees(now_ns, 14), "it calls")
        assert running.stop() == 0, running.said()
        assert "all well" in running.said()
        assert "a fall may come" in running.said()
