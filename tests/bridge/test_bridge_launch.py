"""The launcher's parts that need no process: logs, ports, monitor, screen, and when to end."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bridge_toys import free_ports, listening
from rich.console import Console

from bridge.clock import ManualClock
from bridge.command_line.output import STDOUT
from bridge.config.load import load_config
from bridge.errors import ConfigError, SurefootError, TransportError
from bridge.launch import screen
from bridge.launch.display import JsonLines, Screen
from bridge.launch.launcher import Launcher, Phase, ProcessState
from bridge.launch.logfile import LogFile
from bridge.launch.monitor import Monitor
from bridge.launch.ports import require_free
from bridge.launch.watch import Limits, StopSignals, Watch
from bridge.messages import GaitState, NodeStatus, SupportCommand
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, SUPPORT_COMMAND
from bridge.transport.memory import MemoryHub


def write(log: LogFile, text: str) -> None:
    descriptor = log.open()
    os.write(descriptor, text.encode())
    os.close(descriptor)


class TestLogFile:
    def test_last_line_is_that_of_the_current_process(self, tmp_path: Path) -> None:
        log = LogFile(tmp_path, "drive")
        assert log.last_line() == ""
        write(log, "surefoot drive: bad\nand then\n\n")
        assert log.last_line() == "and then"
        assert log.last_line("surefoot drive: ") == "surefoot drive: bad"
        write(log, "")
        assert log.last_line() == ""
        write(log, "again\n")
        assert log.last_line() == "again"
        assert log.path.read_text() == "surefoot drive: bad\nand then\n\nagain\n"

    def test_stays_small_while_it_is_written(self, tmp_path: Path) -> None:
        log = LogFile(tmp_path, "drive", limit_bytes=100)
        descriptor = log.open()
        for number in range(50):
            os.write(descriptor, f"line {number:03d}\n".encode())
            assert log.last_line() in {f"line {number:03d}", ""}
            assert log.path.stat().st_size <= 110
        os.close(descriptor)
        assert {path.name for path in tmp_path.iterdir()} == {"drive.log", "drive.log.1"}
        kept = (tmp_path / "drive.log.1").read_text() + log.path.read_text()
        assert kept.endswith("line 049\n")


def test_logs_that_cannot_be_written_are_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file/logs: cannot be made"):
        Launcher(load_config(None), log_dir=tmp_path / "file" / "logs")
    (tmp_path / "drive.log").mkdir()
    with pytest.raises(ConfigError, match=r"drive\.log: cannot be written"):
        LogFile(tmp_path, "drive").open()


@pytest.mark.parametrize(
    ("keys", "awaited"), [("", ["anticipation", "alarm"]), ("keys", ["anticipation"])], ids=["open", "certificates"]
)
def test_the_source_waits_for_those_who_can_say_that_they_are_up(tmp_path: Path, keys: str, awaited: list[str]) -> None:
    """An observer's certificate does not let it; whoever waited for it would begin half a minute late."""
    config = load_config(
        None, [f"bridge.keys={keys}", "launch.modules.alarm=x", 'launch.roles=["perception", "anticipation", "alarm"]']
    )
    arguments = Launcher(config, log_dir=tmp_path)._children["perception"]._arguments
    assert [word for before, word in pairwise(arguments) if before == "--after"] == awaited


class TestPorts:
    def test_taken_port_is_named(self) -> None:
        port = free_ports(1)[0]
        endpoints = {"drive": f"tcp/127.0.0.1:{port}", "controller": "tcp/127.0.0.1:1"}
        require_free(endpoints, ["drive"])
        with listening(port):
            require_free(endpoints, ["perception"])
            with pytest.raises(TransportError, match=f"drive .*127.0.0.1:{port}.*in use"):
                require_free(endpoints, ["drive"])

    def test_two_roles_at_one_endpoint(self) -> None:
        endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
        with pytest.raises(TransportError, match="drive and controller"):
            require_free({"drive": endpoint, "controller": endpoint}, ["controller", "drive"])

    def test_a_name_that_does_not_resolve_is_left_to_the_role(self) -> None:
        require_free({"drive": "tls/no.such.host.invalid:7474", "a": "udp/[::1]:0"}, ["drive", "a"])


def process(role: str, phase: Phase = Phase.RUNNING, restarts: int = 0, last_line: str = "") -> ProcessState:
    return ProcessState(role, 4711, phase is Phase.RUNNING, restarts, None, last_line, phase)


def command(now_ns: int, state: GaitState = GaitState.FOLLOW, **changes: Any) -> SupportCommand:
    values: dict[str, Any] = {
        "stamp_ns": now_ns,
        "velocity": np.array([0.4, 0.0, -0.001, 0.0]),
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": 0.75,
        "damping": np.ones(4),
        "stiffness": np.ones(4),
        "state": state,
        "solver": "mpc",
        "lifetime_s": 0.1,
        "reason": "risk [0.8] is high",
    }
    return SupportCommand(**{**values, **changes})


class World:
    """Roles on an in-memory wire, with a monitor that watches them."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        hub = MemoryHub(self.clock)
        self.monitor = Monitor(hub.transport(), self.clock)
        self._hub, self._alive = hub, {}
        self.command = Outbox(hub.transport(), SUPPORT_COMMAND)

    def rise(self, *roles: str) -> None:
        for role in roles:
            transport = self._hub.transport()
            self._alive[role] = transport.declare_alive(role)
            status = NodeStatus(
                stamp_ns=self.clock.now_ns(),
                role=role,
                level=0,
                summary=f"{role} is well",
                values={"rate_hz": "100.0", "horizon_age_ms": "21", "wrench_age_ms": "4"},
            )
            Outbox(transport, DIAGNOSTICS).send(status)

    def fall(self, role: str) -> None:
        self._alive[role].close()


class TestMonitor:
    def test_sees_who_comes_and_goes(self) -> None:
        world = World()
        assert world.monitor.look().roles == {}
        world.rise("controller", "drive")
        roles = world.monitor.look().roles
        assert {name: seen.alive for name, seen in roles.items()} == {"controller": True, "drive": True}
        assert roles["drive"].status is not None
        assert roles["drive"].status.summary == "drive is well"
        world.fall("drive")
        world.clock.advance(2.0)
        roles = world.monitor.look().roles
        assert not roles["drive"].alive
        assert roles["drive"].age_s == pytest.approx(2.0)


class TestScreen:
    @pytest.fixture
    def world(self) -> World:
        world = World()
        world.rise("perception", "controller", "drive")
        world.command.send(command(world.clock.now_ns()))
        return world

    @staticmethod
    def drawn(world: World, processes: Iterable[ProcessState]) -> str:
        console = Console(width=200, record=True, file=Path(os.devnull).open("w"))  # noqa: SIM115
        with console.file:
            console.print(screen.table(1.0, {p.role: p for p in processes}, world.monitor.look(), "a notice"))
        return console.export_text()

    def test_table_says_who_how_fast_how_old_and_what(self, world: World) -> None:
        text = self.drawn(world, [process("perception"), process("controller", restarts=3)])
        row = next(line for line in text.splitlines() if "controller" in line)
        for word in ("running", "alive", "4711", "100.0", "horizon 21", "wrench 4", "3", "controller is well"):
            assert word in row
        assert "age of inputs [ms]" in text
        assert "elsewhere" in next(line for line in text.splitlines() if "drive" in line)
        for word in ("FOLLOW", "0.75", "risk [0.8] is high", "0.40 0.00 m/s, 0.00 rad/s", "a notice"):
            assert word in text

    def test_old_reports_are_not_shown_as_if_they_were_new(self, world: World) -> None:
        world.monitor.look()
        world.clock.advance(5.0)
        text = self.drawn(world, [process("controller", Phase.FAILED, last_line="[boom] it died")])
        assert "100.0" not in text
        assert "is well" not in text
        assert "[boom] it died" in text
        assert "support_command is 5000 ms old" in text

    def test_line_and_record_hold_the_same(self, world: World) -> None:
        processes = {"controller": process("controller", restarts=2), "anticipation": process("anticipation")}
        world.command.send(command(world.clock.advance(0.01), fall_distance=1.5))
        view = world.monitor.look()
        line = screen.line(1.0, processes, view)
        assert "\n" not in line
        for word in ("controller 100.0 Hz (restarted 2x)", "anticipation running", "FOLLOW", "distance 1.50"):
            assert word in line
        record = screen.record(1.0, processes, view)
        assert json.loads(json.dumps(record, allow_nan=False)) == record
        assert record["command"]["fall_distance"] == 1.5
        assert record["command"]["fall_probability"] is None
        assert record["roles"]["anticipation"]["alive"] is False

    def test_before_anything_is_heard(self) -> None:
        view = World().monitor.look()
        assert "no support_command received yet" in screen.line(0.0, {"drive": process("drive")}, view)
        assert screen.record(0.0, {}, view)["command"] is None

    def test_lines_come_once_a_second_and_after_news(self, capsys: pytest.CaptureFixture[str]) -> None:
        view = World().monitor.look()
        with JsonLines(STDOUT) as lines:
            for elapsed_s in (0.0, 0.5, 0.99, 1.0, 1.5):
                lines.show(elapsed_s, {}, view)
            lines.say(1.6, "the end")
            lines.show(1.6, {}, view)
        records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [record["elapsed_s"] for record in records] == [0.0, 1.0, 1.6, 1.6]
        assert records[2]["event"] == "the end"

    def test_screen_draws_and_gives_the_terminal_back(self, capsys: pytest.CaptureFixture[str]) -> None:
        with Screen() as shown:
            shown.say(0.0, "here we go")
            shown.show(0.0, {"drive": process("drive")}, World().monitor.look())
        assert "here we go" in capsys.readouterr().out


class PaperLauncher:
    """A launcher whose processes exist on paper."""

    def __init__(self, *roles: str) -> None:
        self.phases = dict.fromkeys(roles, Phase.WAITING)
        self.lines: dict[str, str] = {}

    def start(self) -> None:
        self.phases = dict.fromkeys(self.phases, Phase.RUNNING)

    def poll(self) -> dict[str, ProcessState]:
        return {role: process(role, phase, last_line=self.lines.get(role, "")) for role, phase in self.phases.items()}


class TestWatch:
    ROLES = ("perception", "anticipation", "controller")

    def begin(self, limits: Limits | None = None) -> tuple[World, PaperLauncher, Watch]:
        world, launcher = World(), PaperLauncher(*self.ROLES)
        return world, launcher, Watch(launcher, world.monitor, limits or Limits())  # type: ignore[arg-type]

    def running(self, limits: Limits | None = None) -> tuple[World, PaperLauncher, Watch]:
        world, launcher, watch = self.begin(limits)
        world.rise("anticipation", "controller")
        watch.turn(None)
        return world, launcher, watch

    @pytest.mark.parametrize("rest", [GaitState.SAFE_STOP, GaitState.DISARMED])
    def test_ends_when_the_controller_holds_still(self, rest: GaitState) -> None:
        world, launcher, watch = self.running()
        world.command.send(command(world.clock.now_ns()))
        launcher.phases["perception"] = Phase.FINISHED
        assert watch.turn(None) == ""
        assert "finished" in watch.news
        assert watch.turn(None) == "", "the controller still follows"
        world.command.send(command(world.clock.advance(0.1), rest))
        assert rest in watch.turn(None)

    def test_ends_at_once_where_no_controller_is_left(self) -> None:
        world, launcher, watch = self.running()
        launcher.phases["perception"] = Phase.FINISHED
        world.fall("controller")
        watch.turn(None)
        assert "end" in watch.turn(None)

    def test_goes_on_when_asked(self) -> None:
        world, launcher, watch = self.running(Limits(keep_running=True))
        launcher.phases["perception"] = Phase.FINISHED
        world.command.send(command(world.clock.advance(0.1), GaitState.SAFE_STOP))
        assert [watch.turn(None) for _ in range(3)] == ["", "", ""]

    def test_ends_when_nothing_is_left(self) -> None:
        _, launcher, watch = self.running()
        launcher.phases = dict.fromkeys(self.ROLES, Phase.FAILED)
        assert "no process" in watch.turn(None)

    def test_ends_on_signals_and_after_its_duration(self) -> None:
        _, _, watch = self.running()
        assert "SIGTERM" in watch.turn(signal.SIGTERM)
        _, _, watch = self.begin(Limits(duration_s=0.0))
        assert "as asked" in watch.turn(None)

    @pytest.mark.parametrize(
        ("line", "said"),
        [("surefoot anticipation: no weights", "anticipation: no weights"), ("", "anticipation refused its input")],
    )
    def test_refusal_is_raised(self, line: str, said: str) -> None:
        _, launcher, watch = self.running()
        launcher.phases["anticipation"], launcher.lines["anticipation"] = Phase.REFUSED, line
        with pytest.raises(SurefootError) as caught:
            watch.turn(None)
        assert str(caught.value) == said


@pytest.mark.parametrize("number", StopSignals.NUMBERS)
def test_signals_are_noted_and_handlers_put_back(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with StopSignals() as stop:
        assert stop.seen is None
        os.kill(os.getpid(), number)
        assert stop.seen is number
    assert signal.getsignal(number) == before
