"""The node before a ROS 2 base: the ROS 2 side is a raw Zenoh session, and its messages are written by pycdr2."""

from __future__ import annotations

import json
import logging
import struct
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from examples_running import REPO, Running
from test_examples_own_drive import command

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.config.load import load_config
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.launch.ports import free_ports
from bridge.messages import Odometry, Wrench
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.plugin import load_module
from bridge.topics import ODOMETRY, SUPPORT_COMMAND, TWIST, WRENCH
from bridge.transport.memory import MemoryHub
from bridge.transport.names import type_hash
from bridge.transport.zenoh import ZenohTransport
from tests.bridge import bridge_idl as idl

FILE = "examples/ros2_base.py"
MS = 1_000_000


def opened(mode: str, listen: Sequence[str] = ("tcp/127.0.0.1:0",), connect: Sequence[str] = ()) -> Any:
    settings = zenoh.Config()
    for path, value in {
        "mode": mode,
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "scouting/multicast/enabled": False,
        "routing/router/peers_failover_brokering": False,
    }.items():
        settings.insert_json5(path, json.dumps(value))
    return zenoh.open(settings)


class Base:
    """A base on ROS 2, as it looks behind zenoh-bridge-ros2dds or on rmw_zenoh: it knows nothing of Surefoot."""

    def __init__(self, port: int, naming: str = "ros2dds", namespace: str = "base") -> None:
        self._namespace = namespace
        self._rmw = naming == "rmw_zenoh"
        endpoint = f"tcp/127.0.0.1:{port}"
        self._router = opened(mode="router", listen=[endpoint])
        # the bridge is a router itself; a node on rmw_zenoh is a peer beside rmw_zenohd, which brokers nothing
        self.session: Any = opened(mode="peer", connect=[endpoint]) if self._rmw else self._router
        self._publishers = {topic: self.session.declare_publisher(self.key(topic)) for topic in (ODOMETRY, WRENCH)}
        self._number = 0
        self.twist: Any = None
        self.heard = threading.Event()
        self._subscriber = self.session.declare_subscriber(
            self.key(TWIST), zenoh.handlers.Callback(self._receive, indirect=False)
        )

    def key(self, topic: Any) -> str:
        if not self._rmw:
            return f"{self._namespace}/{topic.key}"
        name = topic.ros_type.replace("/msg/", "::msg::dds_::")
        return f"0/{self._namespace}/{topic.key}/{name}_/{type_hash(topic.ros_type)}"

    def _receive(self, sample: Any) -> None:
        self.twist = idl.TwistStampedIdl.deserialize(sample.payload.to_bytes())
        self.heard.set()

    def say(self, now_ns: int, forward: float = 0.2, force: float = 12.0) -> None:
        """Publish odometry and wrench, stamped `now_ns`."""
        header = idl.Header(idl.Time(now_ns // 10**9, now_ns % 10**9), "odom")
        pose = idl.Pose(idl.Point(1.0, 2.0, 0.0), idl.Quaternion(0.0, 0.0, 0.0, 1.0))
        twist = idl.Twist(idl.Vector3(forward, 0.0, 0.0), idl.Vector3(0.0, 0.0, 0.1))
        self._put(
            ODOMETRY,
            idl.OdometryIdl(
                header,
                "base_link",
                idl.PoseWithCovariance(pose, [0.0] * 36),
                idl.TwistWithCovariance(twist, [0.0] * 36),
            ),
        )
        pull = idl.Wrench(idl.Vector3(force, 0.0, -30.0), idl.Vector3(0.0, 0.0, 0.0))
        self._put(WRENCH, idl.WrenchStampedIdl(header, pull))

    def _put(self, topic: Any, message: Any) -> None:
        self._number += 1  # rmw_zenoh attaches number, stamp and publisher; the bridge attaches nothing
        attached = struct.pack("<qqB16s", self._number, 0, 16, topic.key.encode().ljust(16)) if self._rmw else None
        self._publishers[topic].put(message.serialize(), attachment=attached)

    def close(self) -> None:
        self.session.close()
        if self._rmw:
            self._router.close()


class Bench:
    """The node in this process: Surefoot's wire in memory, the ROS side over Zenoh."""

    def __init__(self, naming: str, *, late: bool = False, **options: str) -> None:
        port = free_ports(1)[0]
        self.start_base = partial(Base, port, naming)
        self.base, self.clock = None if late else self.start_base(), SystemClock()
        hub = MemoryHub(self.clock)
        given = {"connect": f"tcp/127.0.0.1:{port}", "naming": naming, **options}
        context = NodeContext(load_config(None), hub.transport(), self.clock, logging.getLogger("test"), given)
        self.node = load_module(str(REPO / FILE)).create(context)
        wire = hub.transport()
        self.commands = Outbox(wire, SUPPORT_COMMAND)
        self.odometry: Inbox[Odometry] = Inbox(wire, ODOMETRY)
        self.wrench: Inbox[Wrench] = Inbox(wire, WRENCH)

    def until(self, condition: Any, forward: float = 0.4, *, speak: bool = True, command_it: bool = True) -> None:
        end_s = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < end_s, self.node.status(self.clock.now_ns()).summary
            now_ns = self.clock.now_ns()
            if speak and self.base is not None:
                self.base.say(now_ns)
            if command_it:
                self.commands.send(command(now_ns, forward, velocity=np.array([forward, 0.0, 0.0, 0.05])))
            self.node.step(now_ns)
            time.sleep(0.005)

    def close(self) -> None:
        self.node.close()
        self.base.close()


@pytest.fixture(params=["ros2dds", "rmw_zenoh"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    with closing(Bench(request.param, column_height_m="0.95", sensor_yaw_deg="90")) as bench:
        yield bench


def test_both_sides_hear_each_other(bench: Bench) -> None:
    bench.until(lambda: bench.base.heard.is_set() and bench.base.twist.twist.linear.x > 0.3)
    twist = bench.base.twist
    assert twist.header.frame_id == "base_link"
    assert (twist.twist.linear.z, twist.twist.angular.z) == (0.0, 0.0), "it has no column"
    now_ns = bench.clock.now_ns()
    bench.until(lambda: bench.odometry.read(bench.clock.now_ns()).ok and bench.wrench.read(bench.clock.now_ns()).ok)
    pose = bench.odometry.read(now_ns).message
    assert pose is not None
    assert pose.position == pytest.approx([1.0, 2.0, 0.95]), "the column's height is added"
    assert (pose.velocity[0], pose.yaw_rate) == (0.2, 0.1)
    pull = bench.wrench.read(now_ns).message
    assert pull is not None
    assert pull.force == pytest.approx([0.0, 12.0, -30.0], abs=1e-9), "the sensor is turned by 90 degrees"
    bench.until(lambda: bench.node.status(bench.clock.now_ns()).summary == "follows commands")


def test_a_base_that_falls_silent_is_named_and_nothing_old_is_said_again(bench: Bench) -> None:
    bench.until(lambda: bench.odometry.read(bench.clock.now_ns()).ok)
    bench.until(lambda: "the base: odom is" in bench.node.status(bench.clock.now_ns()).summary, speak=False)
    bench.until(lambda: bench.odometry.read(bench.clock.now_ns()).fault.startswith("odom is"), speak=False)
    turns, said = iter(range(20)), bench.odometry.accepted + bench.odometry.refused
    bench.until(lambda: next(turns, None) is None, speak=False)
    bench.odometry.read(bench.clock.now_ns())
    assert bench.odometry.accepted + bench.odometry.refused == said


def test_without_commands_the_base_is_braked(bench: Bench) -> None:
    bench.until(lambda: bench.base.heard.is_set() and bench.base.twist.twist.linear.x > 0.3)
    bench.until(lambda: abs(bench.base.twist.twist.linear.x) < 1e-6, command_it=False)


def test_a_base_that_is_started_later_is_waited_for() -> None:
    bench = Bench("ros2dds", late=True)
    turns = iter(range(20))
    bench.until(lambda: next(turns, None) is None)
    assert "the base: nothing answers at tcp/127.0.0.1:" in bench.node.status(bench.clock.now_ns()).summary
    bench.base = bench.start_base()
    bench.until(lambda: bench.base.heard.is_set() and bench.odometry.read(bench.clock.now_ns()).ok)
    bench.close()


def test_told_to_stop_it_brakes_the_base_first() -> None:
    bench = Bench("ros2dds")
    bench.until(lambda: bench.base.heard.is_set() and bench.base.twist.twist.linear.x > 0.3)
    bench.node.close()
    end_s = time.monotonic() + 10.0
    while abs(bench.base.twist.twist.linear.x) > 1e-6:
        assert time.monotonic() < end_s
        time.sleep(0.01)
    bench.base.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"naming": "ros1"}, "drive option Input should be 'ros2dds' or 'rmw_zenoh'"),
        ({"connect": "10.0.0.2:7447"}, "expected PROTOCOL/HOST:PORT"),
        ({"sensor_yaw_deg": "north"}, "could not convert string to float: 'north'"),
        ({"topic": "cmd_vel"}, "drive option topic: known: connect, naming, domain, namespace, column_height_m"),
    ],
)
def test_wrong_options_are_said(options: dict[str, str], words: str) -> None:
    module = load_module(str(REPO / FILE))
    with pytest.raises(ConfigError, match=words):
        module.read_options({**module.WIRE, **module.OTHER, **options})


@pytest.mark.parametrize(("naming", "mode"), [("ros2dds", "peer"), ("rmw_zenoh", "client")])
def test_topics_may_be_used_as_they_are(naming: str, mode: str) -> None:
    """A base that says odom and wrench as Surefoot reads them, and takes cmd_vel: no node between, as the page says."""
    port, own = free_ports(2)
    wire = {"naming": naming, "mode": mode, "connect": [f"tcp/127.0.0.1:{port}"]}
    config = BridgeConfig.model_validate(wire | {"endpoints": {"controller": f"tcp/127.0.0.1:{own}"}})
    clock = SystemClock()
    with closing(Base(port, naming, "surefoot")) as base, closing(ZenohTransport(config, "controller", clock)) as ours:
        odometry, wrench, twist = Inbox[Odometry](ours, ODOMETRY), Inbox[Wrench](ours, WRENCH), Outbox(ours, TWIST)
        end_s = time.monotonic() + 30.0
        while not (base.heard.is_set() and odometry.read(clock.now_ns()).ok and wrench.read(clock.now_ns()).ok):
            assert time.monotonic() < end_s
            base.say(clock.now_ns())
            twist.send(command(clock.now_ns(), 0.4))
            time.sleep(0.01)
        assert base.twist.twist.linear.x == 0.4


@pytest.mark.processes
def test_surefoot_up_runs_it(tmp_path: Path) -> None:
    port = free_ports(1)[0]
    options = ("--set", f"launch.modules.drive={FILE}", "--set", f"launch.options.drive.connect=tcp/127.0.0.1:{port}")
    with closing(Base(port)) as base, Running(tmp_path, "drive", "controller", *options) as running:
        commands = Outbox(running.wire, SUPPORT_COMMAND)
        odometry: Inbox[Odometry] = Inbox(running.wire, ODOMETRY)

        def drives(now_ns: int) -> bool:
            base.say(now_ns)
            commands.send(command(now_ns, 0.4))
            heard = base.twist is not None and base.twist.twist.linear.x > 0.3
            return heard and odometry.read(now_ns).ok

        running.until(drives, "the base is driven, and heard")
        assert running.stop() == 0, running.said()
        assert abs(base.twist.twist.linear.x) < 1e-6, "braked before it ended"
        assert np.isfinite(base.twist.twist.linear.y)
