"""The controller that moves the walker: admittance, stiffened as the decision says, rendered by the MPC.

Each step ends in one of three laws, named in the command's `solver`: `mpc`, the first input of an accepted plan;
`fallback`, the one-step admittance law inside the limits, for a bounded time; `stop`, base and column brought to
rest. All three pass the same limiter from the same last acceleration, so changing between them cannot jump.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from bridge.clock import seconds
from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.errors import ConfigError, InvalidMessage
from bridge.messages import Floats, Odometry, SupportCommand, Wrench
from controller.admittance import Admittance, AdmittanceStages
from controller.balance import TipLimits, no_limits, upright
from controller.commanded_motion import CommandedMotion
from controller.fallback import fallback_acceleration, stop_acceleration, within_machine
from controller.interface import Decision
from controller.machine_limits import TIP_ROWS, MachineLimits
from controller.motion_limits import MotionLimits
from controller.mpc.assembly import Instant
from controller.mpc.plan import Failure, Plan
from controller.mpc.predictive_law import PredictiveLaw, fading, remaining
from controller.walker import Walker

Solver = Literal["mpc", "fallback", "stop"]
_ORDINARY_LOAD = 1000.0  # sum over the wrench [N, N m]
_ORDINARY_SPEED = 5.0  # sum over the twist [m/s, rad/s]
_LONGEST_PERIODS = 2.0  # a late step is integrated over at most this many periods


class _Inputs(NamedTuple):
    """What a step rests on, once judged."""

    span_s: float  # since the step before [s]
    wrench: Floats  # (6,) measured now, or foreseen by the last usable one
    draw: Floats  # (4,) force of the coupling to the measured motion
    profile: Floats  # (N,) stiffening
    faults: tuple[str, ...]  # why the MPC must not be asked


class _Rendered(NamedTuple):
    """What the admittance was rendered from."""

    law: AdmittanceStages
    force: Floats  # (4,) generalised force of the person now, with what draws the command to the measured motion


class _Choice(NamedTuple):
    """The acceleration one law asks for, before the limiter."""

    solver: Solver
    wanted: Floats
    rendered: _Rendered | None  # None in a stop
    tip: TipLimits
    reason: str = ""
    solve_time_s: float = 0.0


class AdmittanceController:
    """MPC admittance controller behind the `Controller` protocol.

    Args:
        walker: masses, sizes, limits.
        admittance: what the person feels.
        mpc: horizon, weights, solver, fallback.
        period_s: control period [s].
        lifetime_s: how long a command may be executed [s].

    Raises:
        ConfigError: the held column height lies outside the stroke.
    """

    def __init__(
        self,
        walker: WalkerConfig,
        admittance: AdmittanceConfig,
        mpc: MpcConfig,
        period_s: float = 0.01,
        lifetime_s: float = 0.06,
    ) -> None:
        if not walker.column_low_m <= admittance.height_hold_m <= walker.column_high_m:
            raise ConfigError(
                f"admittance.height_hold_m = {admittance.height_hold_m:g} is outside the column's stroke, "
                f"{walker.column_low_m:g}..{walker.column_high_m:g} (walker.column_low_m, column_high_m)"
            )
        self._config = mpc
        self._period_s = period_s
        self._lifetime_s = lifetime_s
        self._walker = Walker(walker)
        # Yaw is the only rotation, so where the column stands does not matter to the interface's velocity.
        self._interface: Floats = self._walker.terms.interface.copy()
        self._limits = MotionLimits(walker)
        self._machine = MachineLimits(self._walker)
        self._fading = fading(mpc)
        self._stop_damping: Floats = np.array(admittance.damping_arrest)
        self._stop_stiffness: Floats = np.array(admittance.stiffness_stop)
        self._admittance = Admittance(admittance, mpc.stage_s, self._fading)
        self._predictive = PredictiveLaw(self._walker, self._admittance, mpc, period_s)
        self._motion = CommandedMotion(mpc, self._limits, (walker.column_low_m, walker.column_high_m))
        self.reset()

    @property
    def predictive_law(self) -> PredictiveLaw:
        """The MPC behind the commands."""
        return self._predictive

    def reset(self) -> None:
        """Forget the past: the next step starts from the measured motion."""
        self._admittance.reset()
        self._predictive.reset()
        self._motion.rest()
        self._started = False
        self._stopped = False  # whether the last command was a stop: the column is held, however it sags
        self._last_ns: int | None = None
        self._last_solved_ns = 0
        self._wrench_ns = 0
        self._wrench: Floats = np.zeros(6)
        self._profile: Floats = np.zeros(self._config.stages)
        self.last_plan: Plan | None = None

    def step(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> SupportCommand:
        """Return the command for the period that starts at `now_ns`; bad numbers never raise."""
        inputs = self._take(now_ns, odometry, wrench, decision)
        motion = self._motion
        choice = self._choose(now_ns, inputs, decision)
        self._stopped = choice.solver == "stop"
        before = motion.velocity

        def clamp(wanted: Floats) -> Floats:
            return self._limits.clamp(wanted, before, motion.acceleration, float(motion.pose[3]), inputs.span_s)

        acceleration = upright(choice.wanted, choice.tip, clamp)
        motion.advance(acceleration, inputs.span_s)
        law = choice.rendered
        if law is not None:
            self._admittance.settle(before, motion.velocity, law.law, law.force, inputs.span_s)
        reasons = (decision.reason, *inputs.faults, choice.reason)
        return SupportCommand(
            stamp_ns=now_ns,
            velocity=motion.velocity,
            acceleration=acceleration,
            column_height=float(motion.pose[3]),
            stiffening=float(inputs.profile[0]),
            damping=self._stop_damping if law is None else law.law.damping[0],
            stiffness=self._stop_stiffness if law is None else law.law.stiffness[0],
            state=decision.state,
            solver=choice.solver,
            lifetime_s=self._lifetime_s,
            valid=self._started,  # without a motion to start from, holding is all that can be asked for
            reason="; ".join(reason for reason in reasons if reason),
            rests_on_ns=decision.rests_on_ns,
            fall_distance=decision.fall_distance,
            fall_probability=decision.fall_probability,
            solve_time_s=choice.solve_time_s,
        )

    def _take(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> _Inputs:
        """Judge what came in, and put what was foreseen in the place of what cannot be used."""
        faults: list[str] = []
        elapsed_s = self._period_s if self._last_ns is None else seconds(now_ns - self._last_ns)
        span_s = min(max(elapsed_s, 0.0), _LONGEST_PERIODS * self._period_s)
        self._last_ns = now_ns

        fault = _fault(odometry)
        if fault:
            faults.append(fault)
        elif not self._started:
            self._motion.start(odometry)
            self._started = True
            self._last_solved_ns = now_ns
        else:
            self._motion.follow(odometry, span_s, hold_height=decision.stop or self._stopped)
        draw = np.zeros(4) if fault else self._motion.coupling(odometry, self._admittance.mass)

        fault = _fault(wrench)
        if fault:
            faults.append(fault)
        else:
            self._wrench_ns, self._wrench[:3], self._wrench[3:] = now_ns, wrench.force, wrench.torque
        # An unusable wrench is not taken for none: what the last usable one was expected to become stands in,
        # for as long as the fallback may.
        age_s = max(seconds(now_ns - self._wrench_ns), 0.0)
        present = self._wrench * remaining(self._config, age_s)

        profile = decision.profile
        if profile.shape != self._profile.shape:
            faults.append(f"stiffening profile has shape {profile.shape}, expected {self._profile.shape}")
        elif not (profile.min() >= 0.0 and profile.max() <= 1.0):  # false of what is not a number
            faults.append("stiffening profile is not within 0..1")
        else:
            self._profile = profile
        return _Inputs(span_s, present, draw, self._profile, tuple(faults))

    def _choose(self, now_ns: int, inputs: _Inputs, decision: Decision) -> _Choice:
        """Return what the best law that can be had asks for."""
        motion = self._motion
        if not self._started:
            return _Choice("stop", np.zeros(4), None, no_limits(), "no usable odometry yet")
        if decision.stop:
            return self._stop(inputs)

        force: Floats = inputs.wrench @ self._interface + inputs.draw
        law = self._admittance.stages(inputs.profile, motion.pose, motion.velocity, force)
        failure = Failure("", "")
        if not inputs.faults:
            height_m = float(motion.pose[3])
            instant = Instant(law, inputs.wrench, inputs.draw, motion.velocity, motion.acceleration, height_m)
            outcome = self._predictive.plan(instant)
            if isinstance(outcome, Plan):
                self._last_solved_ns = now_ns
                self.last_plan = outcome
                wanted = outcome.acceleration[0]
                tip = TipLimits(*self._predictive.tip_limits)
                return _Choice("mpc", wanted, _Rendered(law, force), tip, solve_time_s=outcome.solve_time_s)
            failure = outcome
        without_s = seconds(now_ns - self._last_solved_ns)
        if without_s > self._config.fallback_max_s:
            reason = f"no plan for {without_s * 1e3:.0f} ms, limit {self._config.fallback_max_s * 1e3:.0f}"
            reason = f"{failure.reason}; {reason}" if failure.reason else reason
            return self._stop(inputs, reason, failure.solve_time_s)
        wanted = fallback_acceleration(law, force, motion.velocity, self._period_s)
        allowed, tip = self._allowed(wanted, inputs)
        return _Choice("fallback", allowed, _Rendered(law, force), tip, failure.reason, failure.solve_time_s)

    def _stop(self, inputs: _Inputs, reason: str = "", solve_time_s: float = 0.0) -> _Choice:
        # The spring is let go: stiffening anew anchors it where the walker comes to rest.
        self._admittance.release()
        wanted = stop_acceleration(self._motion.velocity, self._limits, inputs.span_s)
        allowed, tip = self._allowed(wanted, inputs)
        return _Choice("stop", allowed, None, tip, reason, solve_time_s)

    def _allowed(self, wanted: Floats, inputs: _Inputs) -> tuple[Floats, TipLimits]:
        """Return what the machine can do of `wanted`: the plan's own limits, counted without its code."""
        motion, machine = self._motion, self._machine
        terms = self._walker.evaluate(float(motion.pose[3]), motion.velocity)
        machine.linearise(terms)
        bounds = machine.bounds(terms, inputs.wrench, self._fading[:1])
        allowed = within_machine(wanted, machine.give_way(terms, inputs.wrench, bounds), machine.rows, bounds)
        return allowed, TipLimits(machine.rows[TIP_ROWS], bounds.high[0, TIP_ROWS])


def _fault(message: Odometry | Wrench) -> str:
    """Return why a message must not be acted on, '' if it may."""
    # What is small beyond doubt is not put through the message's own check, which costs as much as the limiter.
    if _ordinary(message):
        return ""
    try:
        message.check()
    except InvalidMessage as error:
        return str(error)
    return ""


def _ordinary(message: Odometry | Wrench) -> bool:
    """Whether a message is far inside what its check allows; of what is not a number that is never true."""
    if isinstance(message, Wrench):
        load: float = sum(map(abs, message.force.tolist() + message.torque.tolist()))
        return load < _ORDINARY_LOAD
    forward, left, column = message.velocity.tolist()
    x, y, height = message.position.tolist()
    speed: float = abs(forward) + abs(left) + abs(column) + abs(message.yaw_rate)
    return speed < _ORDINARY_SPEED and math.isfinite(x + y + height + message.yaw)
