"""The drive node: executes, expires, brakes, holds, reports."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest

from bridge.clock import ManualClock
from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import ODOMETRY, SUPPORT_COMMAND, WRENCH
from bridge.transport.memory import MemoryHub
from simulation.drive.node import DriveNode, create

MS = 1_000_000
NS = 1_000_000_000
PERIOD_NS = 10 * MS


def command(stamp_ns: int, velocity: Any = (0.5, 0.0, 0.0, 0.0), **changes: Any) -> SupportCommand:
    values: dict[str, Any] = {
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": 0.0,
        "damping": np.zeros(4),
        "stiffness": np.zeros(4),
        "state": GaitState.FOLLOW,
        "solver": "mpc",
        "lifetime_s": 0.06,
    }
    return SupportCommand(stamp_ns=stamp_ns, velocity=np.array(velocity, dtype=float), **(values | changes))


class Bench:
    """The drive on an in-memory wire with someone who commands it."""

    def __init__(self, options: dict[str, str] | None = None, config: SurefootConfig | None = None) -> None:
        self.clock = ManualClock(NS)
        self.hub = MemoryHub(self.clock)
        context = NodeContext(
            config or SurefootConfig(),
            self.hub.transport(),
            self.clock,
            logging.getLogger("test"),
            options or {"script": "zero"},
        )
        self.node = DriveNode(context)
        wire = self.hub.transport()
        self.commands = Outbox(wire, SUPPORT_COMMAND)
        self._odometry: Inbox[Odometry] = Inbox(wire, ODOMETRY)
        self._wrench: Inbox[Wrench] = Inbox(wire, WRENCH)
        self.odometry: list[Odometry] = []
        self.wrench: list[Wrench] = []
        self._turn = 0

    def run(self, span_s: float, velocity: Any = None, **changes: Any) -> Odometry:
        """Step for `span_s`, with a new command before each step if a velocity is given."""
        for _ in range(round(span_s * 100)):
            now_ns = NS + self._turn * PERIOD_NS
            self.clock.sleep_until(now_ns)
            if velocity is not None:
                self.commands.send(command(now_ns, velocity, **changes))
            self.node.step(now_ns)
            pose, pull = self._odometry.read(now_ns), self._wrench.read(now_ns)
            assert pose.message is not None
            assert pull.message is not None
            assert pose.ok
            assert pull.ok
            self.odometry.append(pose.message)
            self.wrench.append(pull.message)
            self._turn += 1
        return self.odometry[-1]


def test_drives_as_commanded() -> None:
    bench = Bench()
    pose = bench.run(2.0, (0.5, -0.2, 0.0, 0.0))
    assert pose.velocity == pytest.approx([0.5, -0.2, 0.0], abs=1e-6)
    assert 0.7 < pose.position[0] < 1.0
    assert -0.4 < pose.position[1] < -0.25


def test_stands_until_it_is_told() -> None:
    bench = Bench()
    pose = bench.run(0.5)
    assert pose.position == pytest.approx([0.0, 0.0, 1.0])
    status = bench.node.status(bench.clock.now_ns())
    assert status.level == 1
    assert status.summary.startswith("holds: no command received yet")


def test_expired_commands_brake_the_base_and_hold_the_column() -> None:
    bench = Bench()
    bench.run(1.0, (0.5, 0.0, 0.3, 0.05), column_height=1.05)
    moving = bench.odometry[-1]
    silent_from = len(bench.odometry)
    bench.run(1.0)
    speeds = [o.velocity[0] for o in bench.odometry[silent_from:]]
    assert speeds[4] == pytest.approx(moving.velocity[0], abs=0.02)  # commands live for 60 ms
    assert speeds[12] < 0.95 * moving.velocity[0]
    last = bench.odometry[-1]
    assert (*last.velocity, last.yaw_rate) == pytest.approx((0, 0, 0, 0), abs=1e-4)
    assert last.position[2] == pytest.approx(bench.odometry[-20].position[2], abs=1e-6)
    summary = bench.node.status(bench.clock.now_ns()).summary
    assert summary.startswith("holds: command expired")


def test_safe_command_is_obeyed() -> None:
    bench = Bench()
    bench.run(1.0, (0.5, 0.0, 0.0, 0.0))
    pose = bench.run(1.0, (0.5, 0.0, 0.0, 0.0), valid=False, reason="wrench is 70 ms old")
    assert pose.velocity == pytest.approx(np.zeros(3), abs=1e-4)
    assert bench.node.status(bench.clock.now_ns()).summary == "holds: wrench is 70 ms old"


def test_nonsense_does_not_move_it() -> None:
    bench = Bench()
    pose = bench.run(1.0, (50.0, 0.0, 0.0, 0.0))
    assert pose.position[0] == 0.0
    assert int(bench.node.status(bench.clock.now_ns()).values["gate_refused"]) == 100


def test_a_command_replayed_is_refused() -> None:
    bench = Bench()
    bench.run(0.5, (0.3, 0.0, 0.0, 0.0))
    old = command(NS + 200 * MS, (-0.9, 0.0, 0.0, 0.0))
    bench.commands.send(old)
    pose = bench.run(0.03)
    assert pose.velocity[0] > 0.25


def test_scripted_fall_pulls_at_the_harness() -> None:
    bench = Bench({"script": "fall", "event_s": "0.5"})
    bench.run(1.2)
    assert bench.wrench[-1].force == pytest.approx([0.0, 0.0, -600.0], rel=0.021)
    assert bench.wrench[30].force[2] > -60.0


def test_reports_are_stamped_now_and_numbered() -> None:
    bench = Bench()
    bench.run(0.1)
    assert [o.stamp_ns for o in bench.odometry] == [NS + k * PERIOD_NS for k in range(10)]
    assert [w.sequence for w in bench.wrench] == list(range(10))
    status = bench.node.status(bench.clock.now_ns())
    status.check()
    assert float(status.values["rate_hz"]) == pytest.approx(100.0)
    assert not bench.node.finished()
    bench.node.wait()
    bench.node.close()


def test_a_long_sleep_is_not_driven_through() -> None:
    bench = Bench()
    bench.run(1.0, (0.5, 0.0, 0.0, 0.0))
    before = bench.odometry[-1].position[0]
    bench._turn += 500
    pose = bench.run(0.01)
    assert pose.position[0] - before < 0.06


def test_starts_within_the_stroke() -> None:
    config = parse_config({"drive": {"column_height_m": 0.2}}, "test")
    assert Bench(config=config).run(0.01).position[2] == config.gate.column_low_m


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"script": "dance"}, r"drive option script = dance: .*one of zero, walk, push, fall"),
        ({"tempo": "3"}, "drive option tempo: known: rate_hz"),
        ({"event_s": "-1"}, "drive option event_s = -1: Input should be greater than or equal to 0"),
    ],
)
def test_wrong_options_are_said(options: dict[str, str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Bench(options)


def test_create() -> None:
    clock = ManualClock(NS)
    context = NodeContext(SurefootConfig(), MemoryHub(clock).transport(), clock, logging.getLogger("test"), {})
    assert create(context).period_s == 0.01
