"""The controller process: horizon, wrench and odometry in, gated support command out, 100 times a second."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from bridge.clock import NS
from bridge.config.reload import Watcher
from bridge.errors import ConfigError
from bridge.inbox import Inbox
from bridge.messages import FallHorizon, GaitState, NodeStatus, Odometry, SupportCommand, Wrench
from bridge.node import Node, NodeContext, main
from bridge.outbox import Outbox
from bridge.timing import LoopTiming, Spread
from bridge.topics import FALL_HORIZON, ODOMETRY, SUPPORT_COMMAND, TWIST, WRENCH
from controller.gate import GateLimits, Held, SafetyGate
from controller.interface import Controller, Decision
from controller.intervention.intervention import Intervention
from controller.limits import check_limits
from controller.mock import LoggingController

OK, WARNING, ERROR = 0, 1, 2


class ControllerNode:
    """Intervention -> controller -> safety gate, whatever happens to any of them."""

    def __init__(self, context: NodeContext, controller: Controller) -> None:
        config = context.config
        check_limits(config)
        self._context = context
        self._controller = controller
        self._mock = controller if isinstance(controller, LoggingController) else None
        self._period_s = 1.0 / config.controller.rate_hz
        self._overrun_s = config.controller.overrun_s
        self._thresholds = config.intervention
        self._intervention = Intervention(config.intervention, config.supervisor, config.mpc.stages, config.mpc.stage_s)
        self._gate = SafetyGate(
            GateLimits(**config.gate.model_dump()),
            column_height_m=config.admittance.height_hold_m,
            ordered=False,  # the outbox numbers commands after the gate
            held=Held(config.admittance.damping_arrest, config.admittance.stiffness_stop),
        )
        limits, stuck_s, wire = config.supervisor, config.inputs.stuck_after_s, context.transport
        self._horizon = Inbox[FallHorizon](wire, FALL_HORIZON, limits.horizon_age_limit_s, stuck_after_s=stuck_s)
        self._wrench = Inbox[Wrench](wire, WRENCH, limits.wrench_age_limit_s, stuck_after_s=stuck_s)
        self._odometry = Inbox[Odometry](wire, ODOMETRY, limits.odometry_age_limit_s, stuck_after_s=stuck_s)
        self._ages_s = dict.fromkeys(("horizon", "wrench", "odometry"), math.inf)
        self._command = Outbox(context.transport, SUPPORT_COMMAND)
        self._twist = Outbox(context.transport, TWIST)
        self._watcher = Watcher(context.config_path, context.overrides)
        self._refused_config = ""
        self._failure = ""  # why the controller's last answer was not used
        self._timing = LoopTiming(self._period_s)
        self._solve_s = Spread()  # how long the controller took for its answer
        self._running = False  # the controller answered in the period before
        self._overruns = 0
        self._sent: SupportCommand | None = None

    @property
    def period_s(self) -> float | None:
        """Period of the loop [s]."""
        return self._period_s

    def step(self, now_ns: int) -> None:
        """Decide, compute, gate, publish."""
        self._timing.tick(now_ns)
        self._reload()
        horizon, wrench, odometry = self._horizon.read(now_ns), self._wrench.read(now_ns), self._odometry.read(now_ns)
        self._ages_s = {"horizon": horizon.age_s, "wrench": wrench.age_s, "odometry": odometry.age_s}
        decision = self._intervention.step(now_ns, horizon, wrench, odometry)
        command = self._rest(now_ns, decision) if decision.stop else self._compute(now_ns, decision)
        gated = self._gate.filter(command, now_ns)
        self._command.send(gated)
        self._twist.send(gated)
        self._say_change(gated)
        self._sent = gated

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """The controller runs until it is told to stop."""
        return False

    def close(self) -> None:
        """Stop watching the configuration, close the log and say how it went."""
        self._watcher.close()
        errors, solves = self._timing.error_s.percentiles(), self._solve_s.percentiles()
        self._context.log.info(
            "period error p50 %.3f, p99 %.3f, at most %.3f ms; %d answers took p50 %.3f, p99 %.3f, at most %.3f ms; "
            "%d overruns; %d commands refused by the gate",
            *(1e3 * value for value in errors), self._solve_s.count, *(1e3 * value for value in solves),
            self._overruns, self._gate.refused,
        )  # fmt: skip
        if self._mock is not None:
            self._mock.close()

    def status(self, now_ns: int) -> NodeStatus:
        """Return rate, input ages, state and solver."""
        sent = self._sent
        state = GaitState.DISARMED if sent is None else sent.state
        reason = "not started" if sent is None else sent.reason
        rivals = "; ".join(filter(None, (box.rival(now_ns) for box in (self._horizon, self._wrench, self._odometry))))
        mock_fault = "" if self._mock is None else self._mock.fault
        off = "no intervention whatever happens: intervention.steps_used = 0"
        trouble = self._refused_config or mock_fault or rivals or (off if self._thresholds.steps_used == 0 else "")
        stopped = state in _STOPPED or (sent is not None and sent.solver == "stop")
        level = ERROR if self._failure else WARNING if trouble or stopped else OK
        values = {
            "rate_hz": f"{self._timing.rate_hz():.1f}",
            **self._timing.error_s.report("period_error"),
            **self._solve_s.report("solve"),
            "overruns": str(self._overruns),
            **{f"age_ms.{name}": f"{age_s * 1e3:.0f}" for name, age_s in self._ages_s.items()},
            "state": state.value,
            "reason": reason,
            "solver": "" if sent is None else sent.solver,
            "stiffening": "" if sent is None else f"{sent.stiffening:.2f}",
            "gate_refused": str(self._gate.refused),
            "config": self._refused_config or "in use",
        }
        summary = f"{state.value}: {reason}" + (f" ({trouble})" if trouble else "")
        return NodeStatus(stamp_ns=now_ns, role="controller", level=level, summary=summary, values=values)

    def _rest(self, now_ns: int, decision: Decision) -> SupportCommand:
        """Return what asks the gate for its braking ramp."""
        self._running = False
        self._failure = ""
        odometry = self._intervention.odometry
        if decision.state is GaitState.DISARMED and odometry is not None:
            self._gate.hold(float(odometry.position[2]))
        if self._mock is not None:
            self._mock.stop(now_ns, decision)
        return stop_command(now_ns, decision)

    def _compute(self, now_ns: int, decision: Decision) -> SupportCommand:
        """Return the controller's command, or the safe one if it failed or came too late."""
        failure = ""
        odometry, wrench = self._intervention.odometry, self._intervention.wrench
        assert odometry is not None
        assert wrench is not None  # both by decision.stop being false
        started_ns = self._context.clock.now_ns()
        try:
            if not self._running:
                self._controller.reset()
            command = self._controller.step(now_ns, odometry, wrench, decision)
            # by the node's clock, not the solver's: in simulated time nothing depends on how long the machine took
            command = replace(command, solve_time_s=(self._context.clock.now_ns() - started_ns) / NS)
            self._solve_s.note(command.solve_time_s)
        except Exception as error:  # noqa: BLE001 (whatever it is, the loop must go on and the base must brake)
            failure = f"controller failed: {type(error).__name__}: {error}"
        took_s = (self._context.clock.now_ns() - now_ns) / NS
        if took_s > self._overrun_s:
            self._overruns += 1
            failure = failure or f"controller took {took_s * 1e3:.0f} ms, limit {self._overrun_s * 1e3:.0f}"
        self._running = failure == ""
        if failure and not self._failure:
            self._context.log.error(failure)
        self._failure = failure
        if failure:
            return stop_command(now_ns, decision._replace(state=GaitState.SAFE_STOP, reason=failure))
        return command

    def _reload(self) -> None:
        news = self._watcher.poll()
        if news is None:
            return
        if isinstance(news, str):
            self._refused_config = f"configuration refused: {news}"
            self._context.log.error("%s; the old values stay", self._refused_config)
            return
        if (news.intervention.steps_used == 0) != (self._thresholds.steps_used == 0):
            # Who stands in the walker was told whether it would help; a file saved by mistake must not change that.
            self._refused_config = (
                f"configuration refused: intervention.steps_used = {news.intervention.steps_used} "
                f"({self._thresholds.steps_used} in use): to turn intervention off or on takes a restart"
            )
            self._context.log.error("%s; the old values stay", self._refused_config)
            return
        self._refused_config = ""
        if news.intervention != self._thresholds:
            self._thresholds = news.intervention
            self._intervention.reconfigure(news.intervention)
            self._context.log.info("[intervention] reloaded")
        rest = news.model_copy(update={"intervention": self._context.config.intervention})
        if rest != self._context.config:
            self._context.log.warning("only [intervention] is reloaded while running; restart for the other changes")

    def _say_change(self, command: SupportCommand) -> None:
        if self._sent is None or command.state is not self._sent.state:
            self._context.log.info("%s: %s", command.state.value, command.reason)


_STOPPED: Final = (GaitState.DISARMED, GaitState.SAFE_STOP)


def stop_command(now_ns: int, decision: Decision) -> SupportCommand:
    """Return the command that asks the gate to brake and hold, saying why."""
    return SupportCommand(
        stamp_ns=now_ns,
        velocity=np.zeros(4),
        acceleration=np.zeros(4),
        column_height=0.0,  # the gate holds the height it has
        stiffening=decision.stiffening,
        damping=np.zeros(4),
        stiffness=np.zeros(4),
        state=decision.state,
        solver="stop",
        lifetime_s=SUPPORT_COMMAND.max_age_s,
        valid=False,
        reason=decision.reason,
        rests_on_ns=decision.rests_on_ns,
        fall_distance=decision.fall_distance,
        fall_probability=decision.fall_probability,
    )


def create(context: NodeContext) -> Node:
    """Return the controller node with the controller that option `controller` or the configuration names.

    Raises:
        ConfigError: no such controller, limits that contradict each other, or a log that cannot be written.
    """
    settings = context.config.controller
    kind = context.options.get("controller", settings.kind)
    if kind == "log":
        return ControllerNode(
            context, LoggingController(context.options.get("log", settings.log), settings.log_records)
        )
    if kind != "mpc":
        raise ConfigError(f"controller = {kind}: expected mpc or log")
    # CasADi, OSQP and Pinocchio are loaded only where they are used
    from controller.admittance_controller import AdmittanceController  # noqa: PLC0415

    config = context.config
    return ControllerNode(
        context, AdmittanceController(config.walker, config.admittance, config.mpc, 1.0 / settings.rate_hz)
    )


if __name__ == "__main__":
    raise SystemExit(main("controller", create, priority=lambda config: config.controller.realtime_priority))
