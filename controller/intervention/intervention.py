"""The intervention: readings in, decision out. The same object runs live and, with nominal readings, offline."""

from __future__ import annotations

import numpy as np

from bridge.clock import NS
from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.inbox import Reading
from bridge.messages import FallHorizon, Floats, GaitState, Odometry, Wrench
from controller.interface import Decision
from controller.intervention.inputs import InputWatch
from controller.intervention.known_risk import KnownRisk
from controller.intervention.stiffening import Rates, stiffening_profile
from controller.intervention.supervisor import Evidence, Status, advance

RELAXED = 0.02  # how near the stiffening must be to what the risk asks for to count as released


class Intervention:
    """Ties risk, stiffening and supervisor together; works at any step period."""

    def __init__(
        self, intervention: InterventionConfig, supervisor: SupervisorConfig, stages: int, stage_s: float
    ) -> None:
        """Start DISARMED and free.

        Args:
            intervention: thresholds of risk and stiffening; may be changed with `reconfigure`.
            supervisor: hysteresis, dwell and limits of age.
            stages: number of stages N of the profile.
            stage_s: time between two stages [s].
        """
        self._config = intervention
        self._supervisor = supervisor
        self._stage_s = stage_s
        self._ahead_s: Floats = np.linspace(0.0, (stages - 1) * stage_s, stages)
        self._near_stages = int(np.count_nonzero(self._ahead_s <= supervisor.arrest_reach_s))
        self._known = KnownRisk(intervention)
        self._horizon: InputWatch[FallHorizon] = InputWatch("horizon", supervisor.horizon_age_limit_s)
        self._wrench: InputWatch[Wrench] = InputWatch("wrench", supervisor.wrench_age_limit_s)
        self._odometry: InputWatch[Odometry] = InputWatch("odometry", supervisor.odometry_age_limit_s)
        self._status = Status()
        self._stiffening = 0.0
        self._relaxed = True
        self._now_ns: int | None = None

    @property
    def wrench(self) -> Wrench | None:
        """Newest good wrench; fit for use while the decision is not to stop."""
        return self._wrench.message

    @property
    def odometry(self) -> Odometry | None:
        """Newest good odometry; fit for use while the decision is not to stop."""
        return self._odometry.message

    def reconfigure(self, intervention: InterventionConfig) -> None:
        """Use other thresholds from the next step on; the stiffening goes on from where it is."""
        self._config = intervention
        self._known.reconfigure(intervention)

    def step(
        self, now_ns: int, horizon: Reading[FallHorizon], wrench: Reading[Wrench], odometry: Reading[Odometry]
    ) -> Decision:
        """Return the decision at `now_ns`, which must not run backwards."""
        if self._horizon.take(now_ns, horizon) and self._horizon.message is not None:
            self._known.update(self._horizon.message, self._horizon.stamp_ns)
        self._wrench.take(now_ns, wrench)
        self._odometry.take(now_ns, odometry)
        horizon_fault = self._horizon.fault(now_ns, horizon)
        fault = self._wrench.fault(now_ns, wrench) or self._odometry.fault(now_ns, odometry) or horizon_fault
        risk = self._known.ahead(now_ns, self._ahead_s) if self._active else np.zeros_like(self._ahead_s)
        evidence = self._evidence(now_ns, risk, fault)
        self._status = advance(self._status, evidence, now_ns, self._supervisor)
        profile = self._profile(now_ns, risk, fault)
        newest = None if horizon_fault else self._horizon.message
        return Decision(
            state=self._status.state,
            reason=self._status.reason,
            stiffening=self._stiffening,
            profile=profile,
            fall_distance=float("nan") if newest is None else float(newest.distance.min()),
            fall_probability=float("nan") if newest is None else float(newest.probabilities[-1, 2]),
            rests_on_ns=0 if newest is None else newest.stamp_ns,
        )

    def _evidence(self, now_ns: int, risk: Floats, fault: str) -> Evidence:
        near, ahead = int(risk[: self._near_stages].argmax()), int(risk.argmax())
        odometry = self._odometry.message
        return Evidence(
            fault=fault,
            risk_near=float(risk[near]),
            risk_ahead=float(risk[ahead]),
            why_near=self._words(now_ns, near, risk, self._supervisor.arrest_on),
            why_ahead=self._words(now_ns, ahead, risk, self._supervisor.guard_on),
            load_n=self._load_n(),
            descent_m_s=0.0 if odometry is None or not self._active else -float(odometry.velocity[2]),
            relaxed=self._relaxed,
        )

    def _words(self, now_ns: int, stage: int, risk: Floats, limit: float) -> str:
        """Say what makes up the risk at `stage`; '' below `limit`, where nobody asks."""
        if risk[stage] < limit:
            return ""
        return self._known.words(now_ns, float(self._ahead_s[stage]), float(risk[stage]))

    def _profile(self, now_ns: int, risk: Floats, fault: str) -> Floats:
        elapsed_s = 0.0 if self._now_ns is None else (now_ns - self._now_ns) / NS
        self._now_ns = now_ns
        asked, rates = self._ask(risk, stopped_by_fault=fault != "")
        profile = stiffening_profile(self._stiffening, asked, elapsed_s, self._stage_s, rates)
        self._stiffening = float(profile[0])
        self._relaxed = self._stiffening <= float(asked[0]) + RELAXED
        return profile

    def _ask(self, risk: Floats, *, stopped_by_fault: bool) -> tuple[Floats, Rates]:
        """Return the stiffening that the state asks for at each stage, and the rates it may change at."""
        config, state = self._config, self._status.state
        free = Rates(config.rise_per_s, config.release_per_s)
        if state is GaitState.ARREST:
            return np.ones_like(risk), Rates(config.arrest_per_s, config.release_per_s)
        if (
            state is GaitState.SAFE_STOP
        ):  # never softer than it was, so that following begins firm and softens from there
            return np.maximum(risk, max(self._stiffening, config.unknown_risk)), free
        if state is GaitState.RECOVER:
            return risk, free._replace(release=min(self._supervisor.recover_per_s, config.release_per_s))
        if state is GaitState.DISARMED and stopped_by_fault:
            return np.zeros_like(risk), free
        if state is GaitState.DISARMED and self._load_n() >= self._supervisor.harness_load_arrest_n:
            # started again while a person hangs in the harness: stiff before anything moves
            return np.ones_like(risk), free._replace(rise=config.arrest_per_s)
        return risk, free

    def _load_n(self) -> float:
        """Return the downward pull at the interface [N]; 0 before the first wrench, and to who does not intervene."""
        return 0.0 if self._wrench.message is None or not self._active else -float(self._wrench.message.force[2])

    @property
    def _active(self) -> bool:
        return self._config.steps_used > 0
