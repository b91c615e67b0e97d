"""The drive without a robot: executes commands through a safety gate of its own, reports odometry and wrench."""

from __future__ import annotations

import math
from typing import Any, Final, get_args

import numpy as np
from pydantic import ValidationError

from bridge.clock import NS
from bridge.config.drive import DriveConfig
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import NodeStatus, Odometry, SupportCommand, Wrench
from bridge.node import Node, NodeContext, main
from bridge.outbox import Outbox
from bridge.timing import LoopTiming
from bridge.topics import ODOMETRY, SUPPORT_COMMAND, WRENCH
from controller.gate import GateLimits, Held, SafetyGate
from simulation.drive.motion import DriveModel, DriveState
from simulation.drive.script import scripted_force

LONGEST_STEP_S: Final = 0.1  # a process that slept longer wakes up where it was


class DriveNode:
    """Base and column that follow the gated command; without a command that may be executed they brake and hold."""

    def __init__(self, context: NodeContext) -> None:
        self._config = _with_options(context)
        gate = context.config.gate
        height = min(max(self._config.column_height_m, gate.column_low_m), gate.column_high_m)
        self._model = DriveModel(
            self._config.base_lag_s, self._config.column_lag_s, gate.column_low_m, gate.column_high_m
        )
        self._state = DriveState(height=height)
        admittance = context.config.admittance
        held = Held(admittance.damping_arrest, admittance.stiffness_stop)
        self._gate = SafetyGate(GateLimits(**gate.model_dump()), column_height_m=height, held=held)
        self._commands: Inbox[SupportCommand] = Inbox(context.transport, SUPPORT_COMMAND)
        self._odometry = Outbox(context.transport, ODOMETRY)
        self._wrench = Outbox(context.transport, WRENCH)
        self._timing = LoopTiming(1.0 / self._config.rate_hz)
        self._start_ns: int | None = None
        self._now_ns = 0
        self._executed: SupportCommand | None = None
        self._age_s = math.inf
        self._fault = ""  # what is wrong with what arrives as commands

    @property
    def period_s(self) -> float | None:
        """Period of the loop [s]."""
        return 1.0 / self._config.rate_hz

    def step(self, now_ns: int) -> None:
        """Move on by the time since the last step, then report."""
        self._timing.tick(now_ns)
        if self._start_ns is None:
            self._start_ns = self._now_ns = now_ns
        dt = min(max((now_ns - self._now_ns) / NS, 0.0), LONGEST_STEP_S)
        self._now_ns = now_ns
        if self._executed is not None:
            vx, vy, yaw_rate, column = self._executed.velocity.tolist()
            self._state = self._model.advance(self._state, (vx, vy, yaw_rate, column), dt)
        reading = self._commands.read(now_ns)
        self._age_s, self._fault = reading.age_s, reading.fault
        # the inbox keeps the newest command even when it is stale: the gate lets it expire and says so
        self._executed = self._gate.filter(reading.message, now_ns)
        self._odometry.send(_odometry(self._state, now_ns))
        force = scripted_force(self._config, (now_ns - self._start_ns) / NS)
        self._wrench.send(Wrench(stamp_ns=now_ns, force=force, torque=np.zeros(3)))

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """The drive runs until it is told to stop."""
        return False

    def close(self) -> None:
        """Nothing is held that the transport does not close."""

    def status(self, now_ns: int) -> NodeStatus:
        """Return rate, age of the command, what is executed and where the base is."""
        executed = self._executed
        moving = executed is not None and executed.valid
        reason = "not started" if executed is None else executed.reason
        values = {
            "rate_hz": f"{self._timing.rate_hz():.1f}",
            **self._timing.error_s.report("period_error"),
            "age_ms.command": f"{self._age_s * 1e3:.0f}",
            "x_m": f"{self._state.x:.2f}",
            "y_m": f"{self._state.y:.2f}",
            "speed_m_s": f"{math.hypot(self._state.forward, self._state.left):.2f}",
            "column_m": f"{self._state.height:.3f}",
            "gate_refused": str(self._gate.refused),
        }
        rival = self._commands.rival(now_ns)
        notes = "; ".join(filter(None, ("" if moving else self._fault, rival)))
        summary = ("follows commands" if moving else f"holds: {reason}") + (f" ({notes})" if notes else "")
        level = 0 if moving and not rival else 1
        return NodeStatus(stamp_ns=now_ns, role="drive", level=level, summary=summary, values=values)


def _odometry(state: DriveState, now_ns: int) -> Odometry:
    return Odometry(
        stamp_ns=now_ns,
        position=np.array([state.x, state.y, state.height]),
        yaw=state.yaw,
        velocity=np.array([state.forward, state.left, state.column]),
        yaw_rate=state.yaw_rate,
    )


def _with_options(context: NodeContext) -> DriveConfig:
    """Return `[drive]` with the options of the command line, such as `script=fall`, on top."""
    config = context.config.drive
    changes: dict[str, Any] = {}
    for name, text in context.options.items():
        if name not in DriveConfig.model_fields:
            raise ConfigError(f"drive option {name}: known: {', '.join(DriveConfig.model_fields)}")
        changes[name] = text
    try:
        return DriveConfig.model_validate({**config.model_dump(), **changes})
    except ValidationError as error:
        first = error.errors()[0]
        scripts = ", ".join(get_args(DriveConfig.model_fields["script"].annotation))
        key = ".".join(map(str, first["loc"])) or "options"
        hint = f" (one of {scripts})" if key == "script" else ""
        raise ConfigError(f"drive option {key} = {first['input']}: {first['msg']}{hint}") from error


def create(context: NodeContext) -> Node:
    """Return the drive node; its options override keys of `[drive]`."""
    return DriveNode(context)


if __name__ == "__main__":
    raise SystemExit(main("drive", create))
