"""What the intervention would have done in a case with other thresholds.

The same state machine as live (`advance`), fed with risks that were computed for all turns at
once; where nothing happens in FOLLOW it steps over. `reference.replay_live` runs the very `Intervention`
object instead, many times slower; tests, and every result of a study, are held against it.

What a replay cannot tell: the person and the walker do not react to the changed controller. What it says
holds up to the first intervention that was not in the recording, and after it for as long as the picture
does not depend on what the walker does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.messages import Floats, GaitState
from controller.intervention.intervention import RELAXED
from controller.intervention.known_risk import KnownRisk
from controller.intervention.supervisor import Evidence, Status, advance
from controller.tuning.cases import Case
from controller.tuning.course import BLOCK, Course, Curves, Inputs, Stages, course, curves, inputs

STATES: Final = tuple(GaitState)
DISARMED, FOLLOW, GUARD, ARREST, RECOVER, SAFE_STOP = range(len(STATES))  # as they stand in `GaitState`

# places in a reason that are filled in only where it is kept
_FAULT, _NEAR, _AHEAD = "\ue000", "\ue001", "\ue002"


class Transition(NamedTuple):
    """A change of state."""

    time_s: float  # from the case's start
    before: GaitState
    after: GaitState
    reason: str


@dataclass(frozen=True, slots=True)
class Run:
    """What the intervention did in a case; arrays over its T turns."""

    case: Case
    state: NDArray[np.int8]  # (T,) index into STATES
    stiffening: Floats  # (T,) 0..1
    risk_near: Floats  # (T,) largest risk within `arrest_reach_s`, 0..1
    risk_ahead: Floats  # (T,) largest risk over the horizon, 0..1
    transitions: tuple[Transition, ...]

    @property
    def times_s(self) -> Floats:
        """When the turns were, (T,) [s] from the case's start."""
        return self.case.times_s


def replay(
    case: Case,
    intervention: InterventionConfig,
    supervisor: SupervisorConfig,
    stages: Stages | None = None,
    known: Inputs | None = None,
) -> Run:
    """Return what the intervention would have done in `case`.

    Args:
        case: what the controller was given.
        intervention: the thresholds.
        supervisor: hysteresis, dwell and limits of age.
        stages: of the prediction; None: as `[mpc]` has them by default.
        known: `inputs(case, supervisor)`, if they are at hand: they are the same for all thresholds.
    """
    stages = Stages() if stages is None else stages
    known = inputs(case, supervisor) if known is None else known
    which = curves(case, known, intervention)
    return _Machine(case, intervention, supervisor, stages, known, which).run()


class _Machine:
    def __init__(
        self,
        case: Case,
        intervention: InterventionConfig,
        supervisor: SupervisorConfig,
        stages: Stages,
        known: Inputs,
        which: Curves,
    ) -> None:
        self._case, self._config, self._supervisor, self._stages = case, intervention, supervisor, stages
        self._known, self._which = known, which
        self._course: Course = course(case, which, intervention, supervisor, stages)
        active = intervention.steps_used > 0
        self._load_n = known.load_n if active else np.zeros(case.ticks)
        self._descent_m_s = known.descent_m_s if active else np.zeros(case.ticks)
        self._prepare()

    def run(self) -> Run:
        case, supervisor = self._case, self._supervisor
        state_of, stiffening_of = np.zeros(case.ticks, np.int8), np.zeros(case.ticks)
        transitions: list[Transition] = []
        columns = (*self._course, self._known.faulty, self._load_n, self._descent_m_s)
        first = last = 0  # turns that are at hand as plain numbers
        status, relaxed, s, period_s = Status(), True, 0.0, case.period_ns / NS
        now_ns, turn = case.start_ns, 0
        number = {state: index for index, state in enumerate(STATES)}
        while turn < case.ticks:
            if turn >= last:
                first, last = turn, turn + BLOCK
                rows = list(zip(*(column[first:last].tolist() for column in columns), strict=True))
            now, near, ahead, wanted, faulty, load_n, descent_m_s = rows[turn - first]
            fault = _FAULT if faulty else ""
            evidence = Evidence(fault, near, ahead, _NEAR, _AHEAD, load_n, descent_m_s, relaxed)
            before = status.state
            status = advance(status, evidence, now_ns, supervisor)
            if status.state is not before:
                reason = self._words(status.reason, turn, now_ns)
                transitions.append(Transition(turn * case.period_ns / NS, before, status.state, reason))
            s, relaxed = self._stiffen(
                status.state, s, period_s if turn else 0.0, now, wanted, load_n, faulty
            )  # fmt: skip
            state_of[turn], stiffening_of[turn] = number[status.state], s
            after = max(self._next_event(status.state, s, turn), turn + 1)
            if after > turn + 1:
                state_of[turn:after], stiffening_of[turn:after] = number[status.state], s
            now_ns += (after - turn) * case.period_ns
            turn = after
        return Run(case, state_of, stiffening_of, self._course.near, self._course.ahead, tuple(transitions))

    def _next_event(self, state: GaitState, s: float, turn: int) -> int:
        """Return the first turn after this one at which state or stiffening may change; until then nothing can."""
        if state is GaitState.FOLLOW:
            return int(self._noticed[turn]) if s == 0.0 else 0
        if state is GaitState.ARREST:
            return int(self._stirred[turn]) if s == 1.0 else 0
        usable = int(self._usable[turn])
        if state is GaitState.DISARMED:
            return usable if s == 0.0 else 0
        if state is GaitState.SAFE_STOP and s >= self._config.unknown_risk:
            return usable if self._course.wanted[turn:usable].max(initial=0.0) <= s else 0
        return 0

    def _prepare(self) -> None:
        """Find where something happens to who follows wholly free, to who arrests wholly stiff, to who is stopped."""
        supervisor, risk, faulty = self._supervisor, self._course, self._known.faulty
        noticed = (
            faulty
            | (risk.ahead >= supervisor.guard_on)
            | (risk.near >= supervisor.arrest_on)
            | (risk.wanted > 0.0)
            | (self._load_n >= supervisor.harness_load_arrest_n)
            | (self._descent_m_s >= supervisor.descent_arrest_m_s)
        )
        settled = (
            (risk.near < supervisor.arrest_off)
            & (self._load_n < supervisor.harness_load_release_n)
            & (self._descent_m_s < supervisor.descent_release_m_s)
        )
        self._noticed, self._stirred, self._usable = _next(noticed), _next(faulty | settled), _next(~faulty)

    def _stiffen(
        self, state: GaitState, s: float, elapsed_s: float, now: float, wanted: float, load_n: float, faulty: bool
    ) -> tuple[float, bool]:
        """Return the next stiffening, and whether it has come down to what is asked: `Intervention._profile`.

        `now` is what the risk asks for at this moment, `wanted` what must be begun with for what it asks later.
        """
        config = self._config
        rise, release = config.rise_per_s, config.release_per_s
        if state is GaitState.ARREST:
            now = wanted = 1.0
            rise = config.arrest_per_s
        elif state is GaitState.SAFE_STOP:
            least = max(s, config.unknown_risk)
            now, wanted = max(now, least), max(wanted, least)
        elif state is GaitState.RECOVER:
            release = min(self._supervisor.recover_per_s, release)
        elif state is GaitState.DISARMED and faulty:
            now = wanted = 0.0
        elif state is GaitState.DISARMED and load_n >= self._supervisor.harness_load_arrest_n:
            now = wanted = 1.0
            rise = config.arrest_per_s
        s = min(max(wanted, s - release * elapsed_s), s + rise * elapsed_s)
        s = min(max(s, 0.0), 1.0)
        return s, s <= now + RELAXED

    def _words(self, reason: str, turn: int, now_ns: int) -> str:
        """Fill in what the reason of a transition left open."""
        if _FAULT in reason:
            return reason.replace(_FAULT, self._fault(turn, now_ns))
        if reason not in (_NEAR, _AHEAD):
            return reason
        known, which, horizons = KnownRisk(self._config), self._which, self._case.horizons
        newest, trusted = int(which.newest[turn]), int(which.trusted[turn])
        if 0 <= trusted != newest:
            known.update(horizons.message(trusted), int(which.trusted_start_ns[turn]))
        if newest >= 0:
            known.update(horizons.message(newest), int(which.start_ns[turn]))
        ahead_s = self._stages.ahead_s
        risk = known.ahead(now_ns, ahead_s)
        if reason == _NEAR:
            risk = risk[: int(np.count_nonzero(ahead_s <= self._supervisor.arrest_reach_s))]
        stage = int(risk.argmax())
        return known.words(now_ns, float(ahead_s[stage]), float(risk[stage]))

    def _fault(self, turn: int, now_ns: int) -> str:
        case, known, limits = self._case, self._known, self._supervisor
        if case.pull is not None and known.wrench is not None and known.wrench.faulty[turn]:
            return known.wrench.fault(case.pull.stream, turn, now_ns, limits.wrench_age_limit_s)
        if case.descent is not None and known.odometry is not None and known.odometry.faulty[turn]:
            return known.odometry.fault(case.descent.stream, turn, now_ns, limits.odometry_age_limit_s)
        return known.horizon.fault(case.horizons.stream, turn, now_ns, limits.horizon_age_limit_s)


def _next(happens: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return for each turn the first one from it on where something `happens`; their number where nothing does."""
    places = np.where(happens, np.arange(len(happens)), len(happens))
    return np.minimum.accumulate(places[::-1])[::-1]
