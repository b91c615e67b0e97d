"""The supervisor: every state times every event, hysteresis, dwell, and the reasons."""

from __future__ import annotations

from typing import Any

import pytest
from controller_messages import MS, NS
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.supervisor import SupervisorConfig
from bridge.messages import GaitState
from controller.intervention.supervisor import Evidence, Status, advance

CONFIG = SupervisorConfig()
DISARMED, FOLLOW, GUARD = GaitState.DISARMED, GaitState.FOLLOW, GaitState.GUARD
ARREST, RECOVER, SAFE_STOP = GaitState.ARREST, GaitState.RECOVER, GaitState.SAFE_STOP

CALM = Evidence(
    fault="",
    risk_near=0.0,
    risk_ahead=0.0,
    why_near="near words",
    why_ahead="ahead words",
    load_n=20.0,
    descent_m_s=0.0,
    relaxed=True,
)
LONG_S = 10.0
SHORT_S = 0.015  # shorter than every dwell

EVENTS = {
    "calm": CALM,
    "calm, still stiff": CALM._replace(relaxed=False),
    "input lost": CALM._replace(fault="wrench is 70 ms old, limit 60"),
    "input lost in a fall": CALM._replace(fault="horizon is 160 ms old, limit 150", risk_near=1.0, risk_ahead=1.0),
    "risk between the thresholds": CALM._replace(risk_ahead=0.15, risk_near=0.15),
    "risk ahead": CALM._replace(risk_ahead=0.5),
    "fall ahead, not near": CALM._replace(risk_ahead=1.0),
    "fall near": CALM._replace(risk_near=0.9, risk_ahead=0.9),
    "risk near, not critical": CALM._replace(risk_near=0.5, risk_ahead=0.5),
    "harness load": CALM._replace(load_n=400.0),
    "leaning": CALM._replace(load_n=200.0),
    "descent": CALM._replace(descent_m_s=0.4),
    "slow descent": CALM._replace(descent_m_s=0.1),
    "load and input lost": CALM._replace(fault="odometry is 61 ms old, limit 60", load_n=400.0),
}

# state after the event has lasted long; after a short time every state is still itself, except where marked
AFTER = {
    "calm": {DISARMED: FOLLOW, FOLLOW: FOLLOW, GUARD: FOLLOW, ARREST: RECOVER, RECOVER: FOLLOW, SAFE_STOP: RECOVER},
    "calm, still stiff": {
        DISARMED: FOLLOW,
        FOLLOW: FOLLOW,
        GUARD: FOLLOW,
        ARREST: RECOVER,
        RECOVER: RECOVER,
        SAFE_STOP: RECOVER,
    },
    "input lost": dict.fromkeys(GaitState, SAFE_STOP) | {DISARMED: DISARMED},
    "input lost in a fall": dict.fromkeys(GaitState, SAFE_STOP) | {DISARMED: DISARMED},
    "load and input lost": dict.fromkeys(GaitState, SAFE_STOP) | {DISARMED: DISARMED},
    "risk between the thresholds": {
        DISARMED: FOLLOW,
        FOLLOW: FOLLOW,
        GUARD: GUARD,
        ARREST: RECOVER,
        RECOVER: FOLLOW,
        SAFE_STOP: RECOVER,
    },
    "risk ahead": {
        DISARMED: FOLLOW,
        FOLLOW: GUARD,
        GUARD: GUARD,
        ARREST: RECOVER,
        RECOVER: FOLLOW,
        SAFE_STOP: RECOVER,
    },
    "fall ahead, not near": {
        DISARMED: FOLLOW,
        FOLLOW: GUARD,
        GUARD: GUARD,
        ARREST: RECOVER,
        RECOVER: FOLLOW,
        SAFE_STOP: RECOVER,
    },
    "fall near": dict.fromkeys(GaitState, ARREST),
    "risk near, not critical": {
        DISARMED: FOLLOW,
        FOLLOW: GUARD,
        GUARD: GUARD,
        ARREST: ARREST,
        RECOVER: FOLLOW,
        SAFE_STOP: RECOVER,
    },
    "harness load": dict.fromkeys(GaitState, ARREST),
    "leaning": {DISARMED: FOLLOW, FOLLOW: FOLLOW, GUARD: FOLLOW, ARREST: ARREST, RECOVER: FOLLOW, SAFE_STOP: RECOVER},
    "descent": dict.fromkeys(GaitState, ARREST),
    "slow descent": {
        DISARMED: FOLLOW,
        FOLLOW: FOLLOW,
        GUARD: FOLLOW,
        ARREST: ARREST,
        RECOVER: FOLLOW,
        SAFE_STOP: RECOVER,
    },
}


def at(state: GaitState, now_ns: int = NS) -> Status:
    """Return a status that has just been entered; conditions begin to be timed with the next evidence."""
    return Status(state, "entered", now_ns, in_fall=state is ARREST)


def after(state: GaitState, evidence: Evidence, span_s: float, config: SupervisorConfig = CONFIG) -> Status:
    """Return the status after `evidence` has begun and lasted for `span_s`, looked at twice: at most one transition."""
    status = advance(at(state), evidence, NS, config)
    assert status.state is state or evidence.fault, "no transition without a dwell but for a fault"
    return advance(status, evidence, NS + round(span_s * NS), config) if status.state is state else status


@pytest.mark.parametrize("state", list(GaitState))
@pytest.mark.parametrize("event", list(EVENTS))
def test_every_state_times_every_event(state: GaitState, event: str) -> None:
    assert after(state, EVENTS[event], LONG_S).state is AFTER[event][state]


@pytest.mark.parametrize("state", list(GaitState))
@pytest.mark.parametrize("event", list(EVENTS))
def test_nothing_but_a_fault_acts_without_its_dwell(state: GaitState, event: str) -> None:
    expected = AFTER[event][state] if EVENTS[event].fault else state
    assert after(state, EVENTS[event], SHORT_S).state is expected


def test_the_table_is_whole() -> None:
    assert set(AFTER) == set(EVENTS)
    assert all(set(row) == set(GaitState) for row in AFTER.values())


@pytest.mark.parametrize("event", ["harness load", "descent", "fall near"])
@pytest.mark.parametrize(("state", "dwell_s"), [(DISARMED, CONFIG.arm_dwell_s), (SAFE_STOP, CONFIG.rearm_dwell_s)])
def test_a_fall_that_is_already_there_is_arrested_at_once(state: GaitState, dwell_s: float, event: str) -> None:
    """A controller that is started again, or whose inputs come back, finds a person in the harness."""
    dwell_ns = round(dwell_s * NS)
    assert after(state, EVENTS[event], (dwell_ns - 1) / NS).state is state
    assert after(state, EVENTS[event], dwell_s).state is ARREST


class TestDwell:
    """A transition happens at its dwell, to the nanosecond, and a break starts the count again."""

    @pytest.mark.parametrize(
        ("state", "event", "dwell_s"),
        [
            (DISARMED, "calm", CONFIG.arm_dwell_s),
            (SAFE_STOP, "calm", CONFIG.rearm_dwell_s),
            (FOLLOW, "risk ahead", CONFIG.guard_dwell_s),
            (GUARD, "calm", CONFIG.calm_dwell_s),
            (GUARD, "fall near", CONFIG.arrest_dwell_s),
            (FOLLOW, "harness load", CONFIG.trigger_dwell_s),
            (RECOVER, "descent", CONFIG.trigger_dwell_s),
            (ARREST, "calm", CONFIG.arrest_hold_s),
            (RECOVER, "calm", CONFIG.recover_s),
        ],
    )
    def test_exact(self, state: GaitState, event: str, dwell_s: float) -> None:
        dwell_ns = round(dwell_s * NS)
        assert after(state, EVENTS[event], (dwell_ns - 1) / NS).state is state
        moved = after(state, EVENTS[event], dwell_s)
        assert moved.state is AFTER[event][state]
        assert moved.entered_ns == NS + dwell_ns

    def test_a_break_starts_the_count_again(self) -> None:
        status, now_ns = at(FOLLOW), NS
        for k in range(100):
            now_ns = NS + k * 10 * MS
            status = advance(status, EVENTS["harness load" if k % 2 else "calm"], now_ns, CONFIG)
        assert status.state is FOLLOW

    def test_calm_is_counted_from_the_last_disturbance(self) -> None:
        status = at(GUARD)
        for k in range(40):
            status = advance(status, EVENTS["calm"], NS + k * 10 * MS, CONFIG)
        status = advance(status, EVENTS["risk between the thresholds"], NS + 400 * MS, CONFIG)
        status = advance(status, EVENTS["calm"], NS + 410 * MS, CONFIG)
        status = advance(status, EVENTS["calm"], NS + 900 * MS, CONFIG)
        assert status.state is GUARD


class TestThresholds:
    @pytest.mark.parametrize(
        ("state", "changes", "moves"),
        [
            (FOLLOW, {"risk_ahead": CONFIG.guard_on}, True),
            (FOLLOW, {"risk_ahead": CONFIG.guard_on - 1e-9}, False),
            (GUARD, {"risk_ahead": CONFIG.guard_off - 1e-9}, True),
            (GUARD, {"risk_ahead": CONFIG.guard_off}, False),
            (GUARD, {"risk_near": CONFIG.arrest_on, "risk_ahead": 1.0}, True),
            (GUARD, {"risk_near": CONFIG.arrest_on - 1e-9, "risk_ahead": 1.0}, False),
            (FOLLOW, {"load_n": CONFIG.harness_load_arrest_n}, True),
            (FOLLOW, {"load_n": CONFIG.harness_load_arrest_n - 1e-9}, False),
            (FOLLOW, {"descent_m_s": CONFIG.descent_arrest_m_s}, True),
            (FOLLOW, {"descent_m_s": CONFIG.descent_arrest_m_s - 1e-9}, False),
            (ARREST, {"risk_near": CONFIG.arrest_off - 1e-9}, True),
            (ARREST, {"risk_near": CONFIG.arrest_off}, False),
            (ARREST, {"load_n": CONFIG.harness_load_release_n - 1e-9}, True),
            (ARREST, {"load_n": CONFIG.harness_load_release_n}, False),
            (ARREST, {"descent_m_s": CONFIG.descent_release_m_s - 1e-9}, True),
            (ARREST, {"descent_m_s": CONFIG.descent_release_m_s}, False),
        ],
    )
    def test_exact(self, state: GaitState, changes: dict[str, Any], moves: bool) -> None:
        assert (after(state, CALM._replace(**changes), LONG_S).state is not state) == moves

    def test_a_person_who_pushes_up_is_not_falling(self) -> None:
        assert after(FOLLOW, CALM._replace(load_n=-400.0, descent_m_s=-0.5), LONG_S).state is FOLLOW


class TestRearming:
    def test_without_auto_rearm_a_stop_is_for_good(self) -> None:
        config = SupervisorConfig(auto_rearm=False)
        assert after(SAFE_STOP, CALM, 1000.0, config).state is SAFE_STOP
        assert after(DISARMED, CALM, LONG_S, config).state is FOLLOW

    def test_a_fault_during_the_dwell_starts_it_again(self) -> None:
        status = advance(at(SAFE_STOP), CALM, NS, CONFIG)
        status = advance(status, EVENTS["input lost"], NS + 400 * MS, CONFIG)
        status = advance(status, CALM, NS + 410 * MS, CONFIG)
        status = advance(status, CALM, NS + 900 * MS, CONFIG)
        assert status.state is SAFE_STOP
        assert advance(status, CALM, NS + 910 * MS, CONFIG).state is RECOVER


class TestReasons:
    @pytest.mark.parametrize(
        ("state", "event", "reason"),
        [
            (DISARMED, "calm", "all inputs good for 300 ms"),
            (DISARMED, "input lost", "wrench is 70 ms old, limit 60"),
            (FOLLOW, "input lost", "wrench is 70 ms old, limit 60"),
            (FOLLOW, "risk ahead", "ahead words"),
            (FOLLOW, "fall near", "near words"),
            (GUARD, "harness load", "harness load 400 N, limit 370"),
            (GUARD, "descent", "column descends at 0.40 m/s, limit 0.30"),
            (GUARD, "calm", "risk below 0.1 for 500 ms"),
            (ARREST, "calm", "risk, load and descent low for 1000 ms"),
            (
                ARREST,
                "input lost in a fall",
                "horizon is 160 ms old, limit 150; a fall was in progress, the support stays stiff",
            ),
            (RECOVER, "calm", "support released"),
            (SAFE_STOP, "calm", "all inputs good for 500 ms"),
            (SAFE_STOP, "input lost", "wrench is 70 ms old, limit 60"),
        ],
    )
    def test_every_transition_says_why(self, state: GaitState, event: str, reason: str) -> None:
        assert after(state, EVENTS[event], LONG_S).reason == reason

    def test_the_reason_of_the_transition_stays(self) -> None:
        status = after(FOLLOW, EVENTS["risk ahead"], LONG_S)
        later = advance(status, EVENTS["risk between the thresholds"], NS + 20 * NS, CONFIG)
        assert (later.state, later.reason) == (GUARD, "ahead words")
        assert later.entered_ns == status.entered_ns

    def test_a_stop_remembers_the_fall_it_came_in(self) -> None:
        status = after(FOLLOW, EVENTS["harness load"], LONG_S)
        for k in range(3):
            status = advance(status, EVENTS["input lost"], NS + (20 + k) * NS, CONFIG)
            assert status.reason.endswith("a fall was in progress, the support stays stiff")
        status = advance(status, CALM, NS + 30 * NS, CONFIG)
        status = advance(status, CALM, NS + 31 * NS, CONFIG)
        assert (status.state, status.in_fall) == (RECOVER, False)

    def test_a_stop_names_what_is_wrong_now(self) -> None:
        status = advance(at(SAFE_STOP), EVENTS["input lost"], NS, CONFIG)
        status = advance(status, EVENTS["load and input lost"], NS + MS, CONFIG)
        assert status.reason == "odometry is 61 ms old, limit 60"
        assert status.entered_ns == NS


evidences = st.builds(
    Evidence,
    fault=st.sampled_from(["", "", "", "", "lost"]),
    risk_near=st.floats(0, 1),
    risk_ahead=st.floats(0, 1),
    why_near=st.just("near"),
    why_ahead=st.just("ahead"),
    load_n=st.floats(-500, 800),
    descent_m_s=st.floats(-1, 1),
    relaxed=st.booleans(),
)
ALLOWED = {
    DISARMED: {FOLLOW, ARREST},
    FOLLOW: {GUARD, ARREST, SAFE_STOP},
    GUARD: {FOLLOW, ARREST, SAFE_STOP},
    ARREST: {RECOVER, SAFE_STOP},
    RECOVER: {FOLLOW, ARREST, SAFE_STOP},
    SAFE_STOP: {RECOVER, ARREST},
}


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(evidences, st.sampled_from([1, 10, 33, 400, 2000])), max_size=60))
def test_only_the_drawn_arrows(sequence: list[tuple[Evidence, int]]) -> None:
    status, now_ns = Status(), NS
    for evidence, gap_ms in sequence:
        now_ns += gap_ms * MS
        before, status = status, advance(status, evidence, now_ns, CONFIG)
        assert status.state is before.state or status.state in ALLOWED[before.state]
        assert status.reason
        if evidence.fault:
            assert status.state in {DISARMED, SAFE_STOP}
