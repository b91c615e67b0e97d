"""A drive node of your own: copy this file, replace `Robot`, and name it in the configuration.

surefoot up --source camera:0 --set launch.modules.drive=examples/own_drive.py
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bridge.clock import nanoseconds
from bridge.inbox import Inbox
from bridge.messages import Floats, NodeStatus, Odometry, SupportCommand, Wrench
from bridge.node import NodeContext, main
from bridge.outbox import Outbox
from bridge.topics import ODOMETRY, SUPPORT_COMMAND, WRENCH
from controller.gate import GateLimits, Held, SafetyGate
from simulation.drive.motion import DriveModel, DriveState

PERIOD_S = 0.01


class Measured(NamedTuple):
    """What the robot's sensors say."""

    position: Floats  # x, y in the odometry frame, height of the column [m]
    yaw: float  # [rad]
    velocity: Floats  # forward, left, column [m/s]
    yaw_rate: float  # [rad/s]
    force: Floats  # of the person on the walker: forward, left, up [N]; who hangs in the harness pulls downwards
    torque: Floats  # [N m]


class Robot:
    """Stands in for your motors and sensors: a base and a column that lag, and a person who pushes with about 20 N."""

    def __init__(self, port: str) -> None:
        self.port = port  # open it here; raise bridge.errors.SurefootError("...") if it does not open
        self._model = DriveModel(base_lag_s=0.05, column_lag_s=0.03, column_low_m=0.7, column_high_m=1.2)
        self._state = DriveState(height=1.0)
        self._noise = np.random.default_rng(1)  # every real sensor has some: the same values for 0.3 s are a fault

    def drive(self, forward: float, left: float, yaw_rate: float, column: float) -> None:
        """Send velocities [m/s, m/s, rad/s, m/s]; motors must stop by themselves when this is not called for 100 ms."""
        self._state = self._model.advance(self._state, (forward, left, yaw_rate, column), PERIOD_S)

    def measure(self) -> Measured:
        """Return the newest readings at once; never wait for a sensor here."""
        s = self._state
        position, velocity = np.array([s.x, s.y, s.height]), np.array([s.forward, s.left, s.column])
        force = self._noise.normal([20.0, 0.0, 0.0], 0.2)
        return Measured(position, s.yaw, velocity, s.yaw_rate, force, np.zeros(3))


class OwnDrive:
    """Commands in, through a safety gate of its own; odometry and wrench out; without good commands it brakes."""

    period_s: float | None = PERIOD_S

    def __init__(self, context: NodeContext) -> None:
        gate, admittance = context.config.gate, context.config.admittance
        self._robot, self._clock = Robot(context.options.get("port", "none")), context.clock
        held = Held(admittance.damping_arrest, admittance.stiffness_stop)
        height = float(self._robot.measure().position[2])
        self._gate = SafetyGate(GateLimits(**gate.model_dump()), column_height_m=height, held=held)
        self._commands: Inbox[SupportCommand] = Inbox(context.transport, SUPPORT_COMMAND)
        self._odometry, self._wrench = Outbox(context.transport, ODOMETRY), Outbox(context.transport, WRENCH)
        self._said, self._level = "not started", 1

    def step(self, now_ns: int) -> None:
        """Execute what may be executed now, then report."""
        command = self._commands.read(now_ns).message  # the newest, stale or not: the gate lets it expire
        executed = self._gate.filter(command, now_ns)
        self._robot.drive(*executed.velocity.tolist())
        self._level, self._said = (0, "follows commands") if executed.valid else (1, f"holds: {executed.reason}")
        m = self._robot.measure()
        self._odometry.send(
            Odometry(stamp_ns=now_ns, position=m.position, yaw=m.yaw, velocity=m.velocity, yaw_rate=m.yaw_rate)
        )
        self._wrench.send(Wrench(stamp_ns=now_ns, force=m.force, torque=m.torque))

    def status(self, now_ns: int) -> NodeStatus:
        """Return what `surefoot up` shows."""
        return NodeStatus(stamp_ns=now_ns, role="drive", level=self._level, summary=self._said)

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """A drive runs until it is told to stop."""
        return False

    def close(self) -> None:
        """Told to stop: brake down at the gate's limits, two seconds at most, and only then let go."""
        for _ in range(200):
            if self._gate.at_rest:
                break
            now_ns = self._clock.now_ns()
            self._robot.drive(*self._gate.filter(None, now_ns).velocity.tolist())
            self._clock.sleep_until(now_ns + nanoseconds(PERIOD_S))


def create(context: NodeContext) -> OwnDrive:
    """Return the node."""
    return OwnDrive(context)


if __name__ == "__main__":
    raise SystemExit(main("drive", create))
