"""A controller on a drive that does what it is told, for the tests of the closed loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from controller.admittance_controller import AdmittanceController
from controller.interface import Decision

NS = 1_000_000_000
PERIOD_S = 0.01
# The wall clock of a loaded test machine must decide nothing.
MPC = MpcConfig(time_limit_s=0.1, max_iterations=5000, wrench="held")


def decision(profile: Any = 0.0, state: GaitState = GaitState.FOLLOW, stages: int = 20) -> Decision:
    values = np.broadcast_to(np.asarray(profile, dtype=float), (stages,)).copy()
    return Decision(state, "as the test says", float(values[0]), values, 5.0, 0.0, NS)


class Loop:
    """Drive with first-order lag around a controller; zero lag follows each command at once."""

    def __init__(
        self,
        walker: WalkerConfig | None = None,
        admittance: AdmittanceConfig | None = None,
        mpc: MpcConfig = MPC,
        lag_s: float = 0.0,
        height_m: float = 1.0,
        velocity: Any = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        self.walker = walker or WalkerConfig()
        self.admittance = admittance or AdmittanceConfig()
        self.controller = AdmittanceController(self.walker, self.admittance, mpc, PERIOD_S)
        self.now_ns = NS
        self.pose = np.array([0.0, 0.0, 0.0, height_m])
        self.velocity = np.array(velocity, dtype=float)
        self._share = 1.0 if lag_s == 0.0 else 1.0 - np.exp(-PERIOD_S / lag_s)

    def odometry(self) -> Odometry:
        x, y, yaw, height = self.pose
        forward, left, turn, column = self.velocity
        return Odometry(
            stamp_ns=self.now_ns,
            position=np.array([x, y, height]),
            yaw=float(yaw),
            velocity=np.array([forward, left, column]),
            yaw_rate=float(turn),
        )

    def step(
        self, wrench: Any = (0, 0, 0, 0, 0, 0), profile: Any = 0.0, state: GaitState = GaitState.FOLLOW
    ) -> SupportCommand:
        values = np.asarray(wrench, dtype=float)
        message = Wrench(stamp_ns=self.now_ns, force=values[:3], torque=values[3:])
        command = self.controller.step(self.now_ns, self.odometry(), message, decision(profile, state))
        self.drive(command)
        return command

    def drive(self, command: SupportCommand) -> None:
        before = self.velocity
        self.velocity = before + self._share * (command.velocity - before)
        mean = 0.5 * (before + self.velocity)
        heading = self.pose[2] + 0.5 * PERIOD_S * mean[2]
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        self.pose = self.pose + PERIOD_S * np.concatenate([turn @ mean[:2], mean[2:]])
        self.now_ns += int(PERIOD_S * NS)

    def run(self, seconds: float, wrench: Any, profile: Any = 0.0, **more: Any) -> list[SupportCommand]:
        """Step for a while; wrench may be a function of the time since the start of the run [s]."""
        of_time: Callable[[float], Any] = wrench if callable(wrench) else lambda _: wrench
        return [self.step(of_time(k * PERIOD_S), profile, **more) for k in range(round(seconds / PERIOD_S))]
