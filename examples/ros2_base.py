"""A ROS 2 base that knows nothing of Surefoot: this drive node stands between the two.

    support_command  ->  safety gate  ->  /base/cmd_vel   geometry_msgs/TwistStamped, 100 Hz
    odom             <-  height added <-  /base/odom      nav_msgs/Odometry
    wrench           <-  turned       <-  /base/wrench    geometry_msgs/WrenchStamped

The ROS side has a Zenoh session of its own, to zenoh-bridge-ros2dds or to rmw_zenoh's router; nothing there can write
Surefoot's commands, and Surefoot's processes need no ROS. Options, from `[launch.options.drive]`:

    connect = "tcp/127.0.0.1:7447"    where the bridge or the router listens
    naming = "ros2dds"                or "rmw_zenoh", with `domain` as ROS_DOMAIN_ID
    namespace = "base"                what the three topics begin with
    column_height_m = 1.0             height of the interface above the floor, where the base has no column
    sensor_yaw_deg = 0                how the force sensor is turned against the base
"""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from bridge.clock import nanoseconds
from bridge.config.bridge import BridgeConfig
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import NodeStatus, Odometry, SupportCommand, Wrench
from bridge.node import NodeContext, main
from bridge.outbox import Outbox
from bridge.topics import ODOMETRY, SUPPORT_COMMAND, TWIST, WRENCH
from bridge.transport.zenoh import ZenohTransport
from controller.gate import GateLimits, SafetyGate

PERIOD_S = 0.01
WIRE = {"connect": "tcp/127.0.0.1:7447", "naming": "ros2dds", "domain": "0", "namespace": "base"}
OTHER = {"column_height_m": "1.0", "sensor_yaw_deg": "0"}


class RosSide(NamedTuple):
    """The base's own wire."""

    wire: ZenohTransport
    odometry: Inbox[Odometry]
    wrench: Inbox[Wrench]
    twist: Outbox


class Ros2Base:
    """Turns gated commands into the base's velocity commands, and its sensors into what Surefoot reads."""

    period_s: float | None = PERIOD_S

    def __init__(self, context: NodeContext) -> None:
        wire, self._height_m, yaw_rad = read_options({**WIRE, **OTHER, **context.options})
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        self._turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # sensor's frame -> base's
        self._gate = SafetyGate(GateLimits(**context.config.gate.model_dump()), column_height_m=self._height_m)
        self._commands: Inbox[SupportCommand] = Inbox(context.transport, SUPPORT_COMMAND)
        self._odometry, self._wrench = Outbox(context.transport, ODOMETRY), Outbox(context.transport, WRENCH)
        self._ros: RosSide | None = None
        self._executed: SupportCommand | None = None
        self._faults, self._clock = f"nothing answers at {wire.connect[0]}", context.clock
        threading.Thread(target=self._open, args=(wire,), name="ros", daemon=True).start()

    def step(self, now_ns: int) -> None:
        """Hand commands down and measurements up; what the base does not say anew is not said again."""
        self._executed = self._gate.filter(self._commands.read(now_ns).message, now_ns)
        if (ros := self._ros) is None:
            return
        self._send(ros, self._executed)
        odometry, wrench = ros.odometry.read(now_ns), ros.wrench.read(now_ns)
        self._faults = "; ".join(filter(None, (odometry.fault, wrench.fault)))
        if odometry.fresh and odometry.ok and odometry.message is not None:
            o = odometry.message  # stamps stay those of the measurement
            position, velocity = (*o.position[:2], self._height_m), (*o.velocity[:2], 0.0)
            self._odometry.send(replace(o, position=np.array(position), velocity=np.array(velocity)))
        if wrench.fresh and wrench.ok and wrench.message is not None:
            w = wrench.message
            self._wrench.send(replace(w, force=self._turn @ w.force, torque=self._turn @ w.torque))

    def _open(self, wire: BridgeConfig) -> None:
        """Wait for the bridge or the router, which may be started later, without holding up the loop."""
        ros = ZenohTransport(wire, "drive", self._clock)
        self._ros = RosSide(ros, Inbox(ros, ODOMETRY), Inbox(ros, WRENCH), Outbox(ros, TWIST))

    def _send(self, ros: RosSide, executed: SupportCommand) -> None:
        planar = executed.velocity * (1.0, 1.0, 1.0, 0.0)  # it has no column to move
        ros.twist.send(replace(executed, velocity=planar, frame_id="base_link"))

    def status(self, now_ns: int) -> NodeStatus:
        """Return what `surefoot up` shows: what is wrong with the base, or what it does."""
        executed = self._executed
        holds = "not started" if executed is None else "" if executed.valid else f"holds: {executed.reason}"
        said = f"the base: {self._faults}" if self._faults else holds or "follows commands"
        return NodeStatus(stamp_ns=now_ns, role="drive", level=1 if self._faults or holds else 0, summary=said)

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """A drive runs until it is told to stop."""
        return False

    def close(self) -> None:
        """Told to stop: brake down at the gate's limits, two seconds at most, then leave the ROS side."""
        if (ros := self._ros) is None:
            return
        for _ in range(200):
            if self._gate.at_rest:
                break
            now_ns = self._clock.now_ns()
            self._send(ros, self._gate.filter(None, now_ns))
            self._clock.sleep_until(now_ns + nanoseconds(PERIOD_S))
        ros.wire.close()


def read_options(options: dict[str, str]) -> tuple[BridgeConfig, float, float]:
    """Return the ROS side's wire, the height of the interface [m] and the turn of the sensor [rad].

    Raises:
        ConfigError: an unknown option, or a value that is none.
    """
    for name in options:
        if name not in WIRE and name not in OTHER:
            raise ConfigError(f"drive option {name}: known: {', '.join((*WIRE, *OTHER))}")
    wire = {name: options[name] for name in WIRE} | {"mode": "client", "connect": [options["connect"]]}
    try:
        height_m, yaw_deg = (float(options[name]) for name in OTHER)
        return BridgeConfig.model_validate(wire), height_m, math.radians(yaw_deg)
    except ValidationError as error:
        raise ConfigError(f"drive option {error.errors()[0]['msg'].removeprefix('Value error, ')}") from error
    except ValueError as error:
        raise ConfigError(f"drive option {' or '.join(OTHER)}: {error}") from error


def create(context: NodeContext) -> Ros2Base:
    """Return the node."""
    return Ros2Base(context)


if __name__ == "__main__":
    raise SystemExit(main("drive", create))
