"""The drive node that users copy: follows, refuses, brakes, and can be started by `surefoot up`."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples_running import REPO, Running
from test_examples_alarm import horizon

from bridge.clock import NS, ManualClock
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.plugin import load_module
from bridge.topics import FALL_HORIZON, ODOMETRY, SUPPORT_COMMAND, WRENCH
from bridge.transport.memory import MemoryHub

FILE = "examples/own_drive.py"


def command(stamp_ns: int, forward: float, **changes: Any) -> SupportCommand:
    values: dict[str, Any] = {
        "velocity": np.array([forward, 0.0, 0.0, 0.0]),
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": 0.0,
        "damping": np.zeros(4),
        "stiffness": np.zeros(4),
        "state": GaitState.FOLLOW,
        "solver": "mpc",
        "lifetime_s": 0.06,
    }
    return SupportCommand(stamp_ns=stamp_ns, **(values | changes))


class Bench:
    """The node on an in-memory wire, with time moved by hand."""

    def __init__(self) -> None:
        self.clock = ManualClock(NS)
        hub = MemoryHub(self.clock)
        options = {"port": "/dev/ttyUSB0"}
        context = NodeContext(load_config(None), hub.transport(), self.clock, logging.getLogger("test"), options)
        self.node = load_module(str(REPO / FILE)).create(context)
        wire = hub.transport()
        self.commands = Outbox(wire, SUPPORT_COMMAND)
        self.odometry: Inbox[Odometry] = Inbox(wire, ODOMETRY)
        self.wrench: Inbox[Wrench] = Inbox(wire, WRENCH)

    def run(self, seconds: float, forward: float | None = None, **changes: Any) -> np.ndarray:
        """Return the forward speed of every turn."""
        speeds = []
        for _ in range(round(seconds * 100)):
            now_ns = self.clock.now_ns()
            if forward is not None:
                self.commands.send(command(now_ns, forward, **changes))
            self.node.step(now_ns)
            pose, pull = self.odometry.read(now_ns), self.wrench.read(now_ns)
            assert pose.ok, pose.fault
            assert pull.ok, pull.fault
            assert pose.message is not None
            speeds.append(float(pose.message.velocity[0]))
            self.clock.advance(0.01)
        return np.array(speeds)


def test_follows_commands_within_the_limits_of_the_gate() -> None:
    bench = Bench()
    speeds = bench.run(1.5, 0.5)
    assert speeds[-1] == pytest.approx(0.5, abs=1e-3)
    assert np.diff(speeds).max() < 0.021, "2 m/s^2"
    assert bench.node.status(bench.clock.now_ns()).summary == "follows commands"


def test_expired_commands_brake_it() -> None:
    bench = Bench()
    bench.run(1.5, 0.5)
    speeds = bench.run(1.0)
    assert speeds[3] == pytest.approx(0.5, abs=0.02), "a command lives for 60 ms"
    assert speeds[15] < 0.45
    assert abs(speeds[-1]) < 1e-4
    assert bench.node.status(bench.clock.now_ns()).summary.startswith("holds: command expired")


@pytest.mark.parametrize(
    ("forward", "changes"),
    [(50.0, {}), (float("nan"), {}), (0.5, {"valid": False, "reason": "wrench is old"})],
    ids=["too fast", "not a number", "the safe command"],
)
def test_what_must_not_be_executed_is_not(forward: float, changes: dict[str, Any]) -> None:
    bench = Bench()
    bench.run(1.0, 0.5)
    assert abs(bench.run(1.0, forward, **changes)[-1]) < 1e-4
    assert bench.node.status(bench.clock.now_ns()).level == 1


def test_told_to_stop_it_brakes_before_it_lets_go() -> None:
    bench = Bench()
    bench.run(1.5, 0.8)
    began_ns = bench.clock.now_ns()
    bench.node.close()
    assert 0.3 < (bench.clock.now_ns() - began_ns) / NS < 1.5
    assert abs(bench.node._robot.measure().velocity[0]) < 0.05, "the stand-in lags behind its command"


def test_the_node_is_as_short_as_the_page_says() -> None:
    text = (REPO / FILE).read_text()
    assert text[text.index("class OwnDrive") :].count("\n") <= 60


@pytest.mark.processes
def test_surefoot_up_runs_it_under_its_controller(tmp_path: Path) -> None:
    """It says what the controller needs before it follows anybody; when the horizon ends, it holds."""
    options = ("--set", f"launch.modules.drive={FILE}", "--controller", "log")
    with Running(tmp_path, "controller,drive", "anticipation", *options) as running:
        horizons = Outbox(running.wire, FALL_HORIZON)
        odometry: Inbox[Odometry] = Inbox(running.wire, ODOMETRY)

        def follows(now_ns: int) -> bool:
            horizons.send(horizon(now_ns, None))
            time.sleep(0.02)
            return running.summary("drive") == "follows commands"

        running.until(follows, "it follows")
        assert odometry.read(running.clock.now_ns()).ok
        running.until(lambda _: running.summary("drive").startswith("holds: fall_horizon is"), "it holds, and says why")
        assert running.stop() == 0, running.said()
