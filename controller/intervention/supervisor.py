"""The supervisor: a pure state machine over what is known of the person and of the inputs.

    DISARMED -> FOLLOW <-> GUARD -> ARREST -> RECOVER -> FOLLOW, and SAFE_STOP from anywhere.

`advance` is a function: status, evidence and now in, status out. It reads no clock and keeps nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from bridge.clock import nanoseconds
from bridge.config.supervisor import SupervisorConfig
from bridge.messages import GaitState


class Evidence(NamedTuple):
    """What the supervisor judges by, at one moment."""

    fault: str  # why an input must not be used, in words; '' when all are good
    risk_near: float  # largest risk from now to `arrest_reach_s` ahead, 0..1
    risk_ahead: float  # largest risk from now to the end of the horizon, 0..1
    why_near: str  # what makes up `risk_near`, in words
    why_ahead: str  # what makes up `risk_ahead`, in words
    load_n: float  # downward pull at the interface [N]
    descent_m_s: float  # downward speed of the support column [m/s]
    relaxed: bool  # the stiffening has come down to what the risk asks for


class Since(NamedTuple):
    """Since when each condition has held without a break [ns]; None where it does not hold."""

    good: int | None = None  # all inputs
    risky: int | None = None
    calm: int | None = None
    critical: int | None = None
    loaded: int | None = None
    descending: int | None = None
    settled: int | None = None


class Status(NamedTuple):
    """Where the state machine is."""

    state: GaitState = GaitState.DISARMED
    reason: str = "waiting for inputs"
    entered_ns: int = 0
    since: Since = Since()
    in_fall: bool = False  # an arrest is going on, or a stop came in the middle of one


def advance(status: Status, evidence: Evidence, now_ns: int, config: SupervisorConfig) -> Status:
    """Return the status at `now_ns`; at most one transition a call."""
    since = _measure(status.since, evidence, now_ns, config)
    moment = _Moment(status, evidence, since, now_ns, config)
    transition = _RULES[status.state](moment)
    if transition is None:
        return status._replace(since=since)
    state, reason = transition
    in_fall = state is GaitState.ARREST or (state is GaitState.SAFE_STOP and status.in_fall)
    return Status(state, reason, status.entered_ns if state is status.state else now_ns, since, in_fall)


class _Transition(NamedTuple):
    state: GaitState
    reason: str


class _Moment(NamedTuple):
    status: Status
    evidence: Evidence
    since: Since
    now_ns: int
    config: SupervisorConfig

    def lasted(self, began_ns: int | None, dwell_s: float) -> bool:
        """Whether what began then has lasted for the dwell."""
        return began_ns is not None and self.now_ns - began_ns >= nanoseconds(dwell_s)


def _measure(since: Since, evidence: Evidence, now_ns: int, config: SupervisorConfig) -> Since:
    settled = (
        evidence.risk_near < config.arrest_off
        and evidence.load_n < config.harness_load_release_n
        and evidence.descent_m_s < config.descent_release_m_s
    )
    holds = (
        evidence.fault == "",
        evidence.risk_ahead >= config.guard_on,
        evidence.risk_ahead < config.guard_off,
        evidence.risk_near >= config.arrest_on,
        evidence.load_n >= config.harness_load_arrest_n,
        evidence.descent_m_s >= config.descent_arrest_m_s,
        settled,
    )
    began = (before if before is not None else now_ns for before in since)
    return Since(*(first if held else None for first, held in zip(began, holds, strict=True)))


def _from_disarmed(m: _Moment) -> _Transition | None:
    if m.evidence.fault:
        return _Transition(GaitState.DISARMED, m.evidence.fault)
    if m.lasted(m.since.good, m.config.arm_dwell_s):
        return _arrest(m) or _Transition(GaitState.FOLLOW, f"all inputs good for {m.config.arm_dwell_s * 1e3:.0f} ms")
    return None


def _from_safe_stop(m: _Moment) -> _Transition | None:
    if m.evidence.fault:
        return _safe_stop(m)
    if m.config.auto_rearm and m.lasted(m.since.good, m.config.rearm_dwell_s):
        return _arrest(m) or _Transition(
            GaitState.RECOVER, f"all inputs good for {m.config.rearm_dwell_s * 1e3:.0f} ms"
        )
    return None


def _from_arrest(m: _Moment) -> _Transition | None:
    if m.evidence.fault:
        return _safe_stop(m)
    if m.lasted(m.since.settled, m.config.arrest_hold_s):
        words = f"risk, load and descent low for {m.config.arrest_hold_s * 1e3:.0f} ms"
        return _Transition(GaitState.RECOVER, words)
    return None


def _from_follow(m: _Moment) -> _Transition | None:
    urgent = _stop_or_arrest(m)
    if urgent is None and m.lasted(m.since.risky, m.config.guard_dwell_s):
        return _Transition(GaitState.GUARD, m.evidence.why_ahead)
    return urgent


def _from_guard(m: _Moment) -> _Transition | None:
    urgent = _stop_or_arrest(m)
    if urgent is None and m.lasted(m.since.calm, m.config.calm_dwell_s):
        words = f"risk below {m.config.guard_off:g} for {m.config.calm_dwell_s * 1e3:.0f} ms"
        return _Transition(GaitState.FOLLOW, words)
    return urgent


def _from_recover(m: _Moment) -> _Transition | None:
    urgent = _stop_or_arrest(m)
    if urgent is None and m.evidence.relaxed and m.lasted(m.status.entered_ns, m.config.recover_s):
        return _Transition(GaitState.FOLLOW, "support released")
    return urgent


def _safe_stop(m: _Moment) -> _Transition:
    falling = "; a fall was in progress, the support stays stiff" if m.status.in_fall else ""
    return _Transition(GaitState.SAFE_STOP, m.evidence.fault + falling)


def _stop_or_arrest(m: _Moment) -> _Transition | None:
    """What comes before everything else while moving."""
    return _safe_stop(m) if m.evidence.fault else _arrest(m)


def _arrest(m: _Moment) -> _Transition | None:
    """A fall that is there or near; load and descent do not wait for vision.

    Who is started again, or gets its inputs back, while a person hangs in the harness goes on arresting.
    """
    if m.lasted(m.since.loaded, m.config.trigger_dwell_s):
        words = f"harness load {m.evidence.load_n:.0f} N, limit {m.config.harness_load_arrest_n:.0f}"
        return _Transition(GaitState.ARREST, words)
    if m.lasted(m.since.descending, m.config.trigger_dwell_s):
        words = f"column descends at {m.evidence.descent_m_s:.2f} m/s, limit {m.config.descent_arrest_m_s:.2f}"
        return _Transition(GaitState.ARREST, words)
    if m.lasted(m.since.critical, m.config.arrest_dwell_s):
        return _Transition(GaitState.ARREST, m.evidence.why_near)
    return None


_RULES: Final[dict[GaitState, Callable[[_Moment], _Transition | None]]] = {
    GaitState.DISARMED: _from_disarmed,
    GaitState.FOLLOW: _from_follow,
    GaitState.GUARD: _from_guard,
    GaitState.ARREST: _from_arrest,
    GaitState.RECOVER: _from_recover,
    GaitState.SAFE_STOP: _from_safe_stop,
}
