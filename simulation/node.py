"""The world as a process: in the place of the walker's drive and of the camera, on the topics they would use.

It executes commands through a safety gate of its own, publishes odometry, wrench and detections, and moves physics on
in simulated time that keeps up with the clock.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from bridge.clock import NS, nanoseconds
from bridge.config.simulation import SimulationConfig
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import GaitState, Keypoints, KeypointStatus, NodeStatus, Odometry, SupportCommand, Wrench
from bridge.node import Factory, Node, NodeContext, main
from bridge.outbox import Outbox
from bridge.timing import LoopTiming
from bridge.topics import DETECTIONS, ODOMETRY, SUPPORT_COMMAND, WRENCH
from controller.gate import GateLimits, SafetyGate
from simulation.person.person import CONTROL_S
from simulation.scenarios.scenario import Performance
from simulation.scenarios.single import scenario_from
from simulation.trial.trace import TraceWriter
from simulation.world.camera import Detector, RobotCamera
from simulation.world.parameters import WalkerParameters
from simulation.world.world import sensed

LONGEST_LAG_S: Final = 0.2  # a process that slept longer lets the world sleep too
TURN_NS: Final = nanoseconds(CONTROL_S)


class SimulationNode:
    """The walker, the person and the camera of one scenario."""

    def __init__(self, context: NodeContext, performance: Performance | None = None) -> None:
        """Set the scene of `[simulation]`, or take over a `performance` that was made elsewhere."""
        config, trace = _with_options(context)
        self._trace = TraceWriter(Path(trace)) if trace else None
        if performance is None:
            performance = Performance(scenario_from(config), slack_m=config.harness_slack_m)
        self._performance = performance
        self._performance.waiting = config.begins == "armed"
        self.world = self._performance.world
        self._period_s = 1.0 / config.rate_hz
        self._gate = SafetyGate(
            GateLimits(**context.config.gate.model_dump()), column_height_m=self.world.odometry().position[2]
        )
        self._commands: Inbox[SupportCommand] = Inbox(context.transport, SUPPORT_COMMAND)
        self._odometry = Outbox(context.transport, ODOMETRY)
        self._wrench = Outbox(context.transport, WRENCH)
        self._detections = Outbox(context.transport, DETECTIONS)
        self._camera = RobotCamera(
            config.camera_position_m, config.camera_look_at_m, config.camera_field_of_view_deg,
            config.camera_width_px, config.camera_height_px, config.camera_rate_hz, config.camera_latency_s,
        )  # fmt: skip
        seeds = np.random.SeedSequence(config.seed).spawn(2)
        self._detector = Detector(self._camera, np.random.default_rng(seeds[0]))
        self._noise = np.random.default_rng(seeds[1])
        self._parameters = WalkerParameters()
        offset = self._performance.scenario.faults.force_offset_n
        self._bias = self._parameters.force_bias_n * self._noise.normal(size=3) + offset
        self._timing = LoopTiming(self._period_s)
        self._waiting: deque[tuple[int, Keypoints]] = deque()
        self._start_ns: int | None = None
        self._world_ns = 0
        self._exposed = 0
        self._executed: SupportCommand | None = None
        self._age_s = math.inf

    @property
    def period_s(self) -> float | None:
        """Period of the loop [s]."""
        return self._period_s

    @property
    def executed(self) -> SupportCommand | None:
        """The command under execution, behind the gate."""
        return self._executed

    def step(self, now_ns: int) -> None:
        """Let the world catch up with the clock, then say what its sensors say."""
        self._timing.tick(now_ns)
        if self._start_ns is None:
            self._start_ns = self._world_ns = now_ns
        if now_ns - self._world_ns > nanoseconds(LONGEST_LAG_S):
            slept = now_ns - self._world_ns - TURN_NS
            self._start_ns += slept
            self._world_ns += slept
        velocity = (0.0, 0.0, 0.0, 0.0)
        if self._executed is not None:
            vx, vy, yaw_rate, column = self._executed.velocity.tolist()
            velocity = (vx, vy, yaw_rate, column)
        while self._world_ns + TURN_NS <= now_ns:
            self._performance.advance(velocity)
            if self._trace is not None:
                self._trace.note(self._performance, self._world_ns + TURN_NS)
            self._world_ns += TURN_NS
            self._expose()
        reading = self._commands.read(now_ns)
        self._age_s = reading.age_s
        # the inbox keeps the newest command even when it is stale: the gate lets it expire and says so
        self._executed = self._gate.filter(reading.message, now_ns)
        if self._executed.valid and self._executed.state is GaitState.FOLLOW:
            self._performance.waiting = False
        self._say(now_ns)

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """Whether the trial that is traced is over; without a trace the world goes on until it is told to stop."""
        return self._trace is not None and self._performance.time_s >= self._performance.scenario.duration_s

    def close(self) -> None:
        """Write the trace, if one was asked for with the option `trace=FILE`."""
        if self._trace is not None:
            self._trace.save()

    def status(self, now_ns: int) -> NodeStatus:
        """Return rate, age of the command, and how person and walker are."""
        executed, world = self._executed, self.world
        moving = executed is not None and executed.valid
        reason = "not started" if executed is None else executed.reason
        odometry = world.odometry()
        values = {
            "rate_hz": f"{self._timing.rate_hz():.1f}",
            **self._timing.error_s.report("period_error"),
            "age_ms.command": f"{self._age_s * 1e3:.0f}",
            "scenario": self._performance.scenario.title,
            "x_m": f"{odometry.position[0]:.2f}",
            "y_m": f"{odometry.position[1]:.2f}",
            "column_m": f"{odometry.position[2]:.3f}",
            "pelvis_m": f"{world.pelvis_m[2]:.3f}",
            "person": "down" if world.touched_down() else "given up" if world.person.fallen else "on their feet",
            "gate_refused": str(self._gate.refused),
        }
        summary = "follows commands" if moving else f"holds: {reason}"
        return NodeStatus(stamp_ns=now_ns, role="drive", level=0 if moving else 1, summary=summary, values=values)

    def _expose(self) -> None:
        """Take a picture when one is due in the world's time."""
        assert self._start_ns is not None
        due_ns = self._start_ns + round(self._exposed * NS / self._camera.rate_hz)
        if self._world_ns < due_ns:
            return
        self._exposed += 1
        odometry = self.world.odometry()
        x, y, _ = odometry.position
        points, depth = self._camera.project(self.world.keypoints(), (x, y, odometry.yaw))
        if self._performance.scenario.faults.blind(self._performance.time_s):
            points = np.full_like(points, np.nan)
        seen = self._detector.observe(points, depth)
        lost = ~np.isfinite(seen.points[:, :2]).all(axis=1)
        trunk = seen.points[:2, :2].mean(axis=0) - seen.points[6:8, :2].mean(axis=0)
        message = Keypoints(
            stamp_ns=self._world_ns,
            position_px=seen.points[:, :2],
            confidence=seen.points[:, 2],
            status=np.where(lost, KeypointStatus.LOST, KeypointStatus.MEASURED).astype(np.uint8),
            body_length_px=float(np.linalg.norm(trunk)) if np.isfinite(trunk).all() else 1.0,
            image_width=self._camera.width_px,
            image_height=self._camera.height_px,
            people=int(seen.found),
        )
        self._waiting.append((self._world_ns + nanoseconds(self._camera.latency_s), message))

    def _say(self, now_ns: int) -> None:
        while self._waiting and self._waiting[0][0] <= now_ns:
            self._detections.send(self._waiting.popleft()[1])
        odometry = self.world.odometry()
        forward, left, column = odometry.velocity
        self._odometry.send(
            Odometry(
                stamp_ns=now_ns,
                position=np.array(odometry.position),
                yaw=odometry.yaw,
                velocity=np.array([forward, left, column]),
                yaw_rate=odometry.yaw_rate,
            )
        )
        force, torque = sensed(self.world.wrench, self._bias, self._noise.standard_normal, self._parameters)
        self._wrench.send(Wrench(stamp_ns=now_ns, force=force, torque=torque))


def _with_options(context: NodeContext) -> tuple[SimulationConfig, str]:
    """Return `[simulation]` with the options of the command line, such as `scenario=trip`, on top, and `trace`."""
    changes: dict[str, Any] = {}
    options = dict(context.options)
    trace = options.pop("trace", "")
    for name, text in options.items():
        if name not in SimulationConfig.model_fields:
            raise ConfigError(f"simulation option {name}: known: trace, {', '.join(SimulationConfig.model_fields)}")
        changes[name] = text
    try:
        return SimulationConfig.model_validate({**context.config.simulation.model_dump(), **changes}), trace
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "options"
        raise ConfigError(f"simulation option {key} = {first['input']}: {first['msg']}") from error


def create(context: NodeContext) -> Node:
    """Return the simulation node; its options override keys of `[simulation]`."""
    return SimulationNode(context)


def performing(performance: Performance, made: Callable[[SimulationNode], None]) -> Factory:
    """Return what makes a node of `performance` for a campaign; `made` is called with the node."""

    def factory(context: NodeContext) -> Node:
        node = SimulationNode(context, performance)
        made(node)
        return node

    return factory


if __name__ == "__main__":
    raise SystemExit(main("drive", create))
