"""The intervention as a whole: readings in, decisions out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from controller_messages import MS, NS, bad, good, horizon, odometry, wrench
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.inbox import Reading
from bridge.messages import STEPS, FallHorizon, GaitState
from controller.interface import Decision
from controller.intervention.inputs import InputWatch
from controller.intervention.intervention import Intervention

STAGES, STAGE_S = 20, 0.025
ARMED_S = SupervisorConfig().arm_dwell_s


def distance_alone(**changes: Any) -> InterventionConfig:
    """Thresholds with which the distance arrests without a foreseen fall: these tests drive one cue at a time."""
    return InterventionConfig(**{"unconfirmed_most": 1.0, **changes})


class Person:
    """Runs an intervention in simulated time; horizons come at 30 Hz, wrench and odometry at every step."""

    def __init__(self, period_s: float = 0.01, **intervention: Any) -> None:
        self.intervention = Intervention(distance_alone(**intervention), SupervisorConfig(), STAGES, STAGE_S)
        self.period_ns = round(period_s * NS)
        self.now_ns = NS
        self.history: list[Decision] = []
        self.newest: FallHorizon | None = None
        self.next_frame_ns = NS

    def run(
        self,
        span_s: float,
        see: Callable[[float], dict[str, Any]] | None = None,
        *,
        lost: frozenset[str] = frozenset(),
        load_n: float = 0.0,
        descent: float = 0.0,
    ) -> Decision:
        """Step for `span_s`; `see(t)` gives what the horizon says, `lost` names inputs that have gone silent."""
        start_ns = self.now_ns
        while self.now_ns - start_ns < round(span_s * NS):
            t = (self.now_ns - start_ns) / NS
            if "horizon" not in lost and self.now_ns >= self.next_frame_ns:
                self.newest = horizon(self.now_ns, **(see(t) if see else {}))
                self.next_frame_ns = self.now_ns + NS // 30
            seen: Reading[Any] = bad("no fall_horizon received yet")
            if self.newest is not None:
                age_s = (self.now_ns - self.newest.stamp_ns) / NS
                fault = f"fall_horizon is {age_s * 1e3:.0f} ms old, limit 150" if age_s > 0.15 else ""
                seen = Reading(self.newest, age_s, fault, not fault)
            pull = bad("wrench is not finite") if "wrench" in lost else good(wrench(self.now_ns, (0, 0, -load_n)))
            pose = bad("no odom") if "odometry" in lost else good(odometry(self.now_ns, descent))
            self.history.append(self.intervention.step(self.now_ns, seen, pull, pose))
            self.now_ns += self.period_ns
        return self.history[-1]

    def states(self) -> list[GaitState]:
        """Return the states gone through, each once."""
        states = [d.state for d in self.history]
        return [s for k, s in enumerate(states) if k == 0 or s is not states[k - 1]]

    def jumps(self) -> float:
        """Return the largest change of the present stiffening from one step to the next."""
        return float(np.abs(np.diff([d.stiffening for d in self.history])).max())


def walking(_t: float) -> dict[str, Any]:
    return {"distance": 5.0, "rate": -0.5}


def falling(t: float) -> dict[str, Any]:
    """From +5 sd to the boundary at 6 sd/s; the horizon foresees it half a second ahead."""
    ahead = np.arange(STEPS) / 30
    return {"distance": np.maximum(5.0 - 6.0 * (t + ahead), -2.0), "rate": -6.0}


class TestLifeOfAFall:
    @pytest.mark.parametrize("period_s", [0.005, 0.01, 0.033, 0.06])
    def test_anticipated_arrested_recovered(self, period_s: float) -> None:
        person = Person(period_s)
        person.run(2.0, walking)
        person.run(2.0, falling)
        assert person.history[-1].state is GaitState.ARREST
        assert person.history[-1].stiffening == 1.0
        person.run(6.0, walking)
        assert person.states() == [
            GaitState.DISARMED,
            GaitState.FOLLOW,
            GaitState.GUARD,
            GaitState.ARREST,
            GaitState.RECOVER,
            GaitState.FOLLOW,
        ]
        assert person.history[-1].stiffening == 0.0

    def test_prediction_stiffens_before_the_present(self) -> None:
        person = Person()
        person.run(1.0, walking)
        person.run(1.0, falling)
        ahead = next(k for k, d in enumerate(person.history) if d.profile[-1] > 0.3)
        now = next(k for k, d in enumerate(person.history) if d.stiffening > 0.3)
        assert now - ahead > 10  # 100 ms

    def test_stiff_before_the_boundary_is_crossed(self) -> None:
        person = Person()
        person.run(1.0, walking)
        person.run(5.0 / 6.0, falling)
        assert person.history[-1].stiffening == 1.0

    def test_walking_is_left_alone(self) -> None:
        rng = np.random.default_rng(1)
        person = Person()
        person.run(
            20.0,
            lambda t: {
                "distance": 4.5 + rng.normal(0, 0.5),
                "rate": rng.normal(0, 2.5),
                "fall": 0.05,
                "transient": 0.1,
            },
        )
        assert person.states() == [GaitState.DISARMED, GaitState.FOLLOW]
        assert max(d.stiffening for d in person.history) < 0.1

    def test_guard_says_why(self) -> None:
        person = Person()
        person.run(1.0, walking)
        person.run(0.2, falling)
        guard = next(d for d in person.history if d.state is GaitState.GUARD)
        assert guard.reason.startswith("fall boundary")
        assert "foreseen in" in guard.reason


class TestWithoutVision:
    def test_harness_load(self) -> None:
        person = Person()
        person.run(1.0, walking)
        decision = person.run(0.1, walking, load_n=500.0)
        assert decision.state is GaitState.ARREST
        assert decision.reason == "harness load 500 N, limit 370"
        assert decision.stiffening == 1.0

    @pytest.mark.parametrize(
        "sight", [{"distance": 6.0}, {"quality": 0.0}, {"fall": 0.0, "transient": 0.0, "distance": 9.0}]
    )
    @pytest.mark.parametrize("felt", [{"load_n": 380.0}, {"descent": 0.31}])
    def test_whatever_is_seen(self, sight: dict[str, Any], felt: dict[str, float]) -> None:
        """Steady, nobody in view, surely stable: load and descent arrest within their dwell and one period."""
        person = Person()
        person.run(1.0, lambda t: sight)
        person.run(SupervisorConfig().trigger_dwell_s + 0.011, lambda t: sight, **felt)
        assert person.history[-1].state is GaitState.ARREST

    def test_descent(self) -> None:
        person = Person()
        person.run(1.0, walking)
        assert person.run(0.1, walking, descent=0.4).reason == "column descends at 0.40 m/s, limit 0.30"


class TestRestart:
    def test_with_a_person_in_the_harness_the_first_command_to_follow_is_stiff(self) -> None:
        person = Person()
        person.run(0.5, walking, load_n=600.0)
        assert person.states() == [GaitState.DISARMED, GaitState.ARREST]
        moving = [decision for decision in person.history if not decision.stop]
        assert min(decision.stiffening for decision in moving) == pytest.approx(1.0)
        assert "harness load 600 N" in moving[0].reason

    def test_with_a_walking_person_it_is_free(self) -> None:
        person = Person()
        person.run(0.5, walking, load_n=60.0)
        assert person.states() == [GaitState.DISARMED, GaitState.FOLLOW]
        assert max(decision.stiffening for decision in person.history) < 0.1


class TestLoss:
    @pytest.mark.parametrize(("name", "limit_s"), [("horizon", 0.2), ("wrench", 0.1), ("odometry", 0.1)])
    def test_safe_stop_in_time_and_return_through_recover(self, name: str, limit_s: float) -> None:
        person = Person()
        person.run(2.0, walking)
        person.history.clear()
        lost_ns = person.now_ns - person.period_ns if name != "horizon" else person.newest.stamp_ns  # type: ignore[union-attr]
        start_ns = person.now_ns
        decision = person.run(1.0, walking, lost=frozenset({name}))
        stopped = next(k for k, d in enumerate(person.history) if d.state is GaitState.SAFE_STOP)
        assert (start_ns + stopped * person.period_ns - lost_ns) / NS <= limit_s
        assert decision.stop
        person.run(10.0, walking)
        assert person.states()[-3:] == [GaitState.SAFE_STOP, GaitState.RECOVER, GaitState.FOLLOW]
        assert person.jumps() <= 8.0 * 0.01 + 1e-9

    def test_a_short_gap_is_bridged(self) -> None:
        person = Person()
        person.run(2.0, walking)
        person.run(0.04, walking, lost=frozenset({"wrench"}))
        person.run(0.10, walking, lost=frozenset({"horizon"}))
        person.run(0.5, walking)
        assert person.history[-1].state is GaitState.FOLLOW
        assert person.intervention.wrench is not None
        assert person.intervention.odometry is not None

    def test_support_stays_stiff_when_vision_is_lost_in_a_fall(self) -> None:
        person = Person()
        person.run(1.0, walking)
        person.run(1.2, falling)
        decision = person.run(2.0, walking, lost=frozenset({"horizon"}))
        assert decision.state is GaitState.SAFE_STOP
        assert decision.stiffening == 1.0
        assert any("a fall was in progress" in d.reason for d in person.history)

    def test_rejoining_begins_firm(self) -> None:
        person = Person()
        person.run(1.0, walking)
        decision = person.run(1.0, walking, lost=frozenset({"odometry"}))
        assert decision.stiffening == pytest.approx(InterventionConfig().unknown_risk)

    def test_no_horizon_no_numbers(self) -> None:
        person = Person()
        decision = person.run(0.1, walking, lost=frozenset({"horizon"}))
        assert math.isnan(decision.fall_distance)
        assert math.isnan(decision.fall_probability)
        assert decision.rests_on_ns == 0
        assert decision.state is GaitState.DISARMED
        assert decision.stiffening == 0.0
        assert decision.reason == "no fall_horizon received yet"

    def test_numbers_are_those_of_the_horizon(self) -> None:
        person = Person()
        fall = np.linspace(0.0, 0.3, STEPS)
        decision = person.run(0.05, lambda t: {"distance": np.linspace(5, 4, STEPS), "fall": fall})
        assert decision.fall_distance == 4.0
        assert decision.fall_probability == pytest.approx(0.3)
        assert decision.rests_on_ns == person.newest.stamp_ns  # type: ignore[union-attr]


class TestQuality:
    def test_a_person_out_of_sight_is_guarded_not_followed_freely(self) -> None:
        person = Person()
        person.run(2.0, walking)
        decision = person.run(1.5, lambda t: {"distance": 6.0, "quality": 0.1})
        assert decision.state is GaitState.GUARD
        assert decision.stiffening == pytest.approx(InterventionConfig().unknown_risk)
        assert "not known to be stable" in decision.reason

    def test_low_quality_does_not_end_an_alarm(self) -> None:
        person = Person()
        person.run(1.0, walking)
        person.run(1.2, falling)
        person.run(0.3, lambda t: {"distance": 6.0, "quality": 0.1})
        assert person.history[-1].stiffening == 1.0


class TestReload:
    def test_without_a_jump(self) -> None:
        person = Person()
        person.run(1.0, lambda t: {"distance": 2.0})
        assert person.history[-1].stiffening == 0.0
        person.intervention.reconfigure(distance_alone(distance_onset_sd=6.0, distance_full_sd=3.0))
        person.history = person.history[-1:]
        person.run(0.02, lambda t: {"distance": 2.0})
        assert 0.0 < person.history[-1].stiffening < 0.2
        person.run(0.5, lambda t: {"distance": 2.0})
        assert person.history[-1].stiffening == 1.0
        assert person.jumps() <= 20.0 * 0.01 + 1e-9

    def test_back_to_the_old_values_releases_slowly(self) -> None:
        person = Person(distance_onset_sd=6.0, distance_full_sd=0.0)
        person.run(1.0, lambda t: {"distance": 2.0})
        held = person.history[-1].stiffening
        person.intervention.reconfigure(distance_alone())
        person.run(0.1, lambda t: {"distance": 2.0})
        assert person.history[-1].stiffening == pytest.approx(held - 0.1, abs=0.02)


class TestInputWatch:
    def test_stamp_ahead_of_our_clock_is_not_a_longer_life(self) -> None:
        watch: InputWatch[Any] = InputWatch("wrench", 0.06)
        watch.take(NS, good(wrench(NS + 40 * MS), age_s=-0.04))
        assert watch.fault(NS + 60 * MS, bad("")) == ""
        assert watch.fault(NS + 61 * MS, bad("")) == "wrench is 61 ms old, limit 60"

    def test_same_message_given_again_with_a_new_age_is_fresh_but_not_new(self) -> None:
        watch: InputWatch[Any] = InputWatch("wrench", 0.06)
        nominal = wrench(NS)
        assert watch.take(NS, good(nominal))
        assert not watch.take(NS + 500 * MS, good(nominal))
        assert watch.fault(NS + 500 * MS, good(nominal)) == ""

    def test_never_received(self) -> None:
        watch: InputWatch[Any] = InputWatch("wrench", 0.06)
        assert watch.fault(NS, Reading(None, math.inf, "", False)) == "no wrench received yet"


anything = st.one_of(st.floats(-1000, 1000), st.sampled_from([0.0, 1e3, -1e3]))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 120),  # step [ms]
            st.sampled_from(["good", "good", "good", "bad", "same"]),
            anything,  # distance
            st.floats(-1e5, 1e5),  # rate
            st.floats(0, 1),  # fall
            st.floats(0, 1),  # quality
            st.floats(-0.05, 0.3),  # age of the horizon [s]
            st.floats(-3000, 3000),  # vertical force
            st.floats(-2, 2),  # column velocity
        ),
        max_size=40,
    )
)
def test_whatever_is_seen_the_profile_is_finite_bounded_and_rate_limited(turns: list[Any]) -> None:
    config = InterventionConfig()
    intervention = Intervention(config, SupervisorConfig(), STAGES, STAGE_S)
    now_ns, before, newest = NS, 0.0, good(horizon(NS))
    rise = config.arrest_per_s
    turns = [(0, *turn[1:]) if k == 0 else turn for k, turn in enumerate(turns)]
    for gap_ms, kind, distance, rate, fall, quality, age_s, force, speed in turns:
        now_ns += gap_ms * MS
        if kind == "good":
            seen = horizon(now_ns - round(age_s * NS), distance=distance, rate=rate, fall=fall, quality=quality)
            newest = good(seen, age_s)
        elif kind == "bad":
            newest = bad("garbage")
        decision = intervention.step(
            now_ns, newest, good(wrench(now_ns, (0, 0, force))), good(odometry(now_ns, descent=-speed))
        )
        s = decision.profile
        assert s.shape == (STAGES,)
        assert np.isfinite(s).all()
        assert ((s >= 0.0) & (s <= 1.0)).all()
        assert s[0] == decision.stiffening
        assert -config.release_per_s * gap_ms / 1e3 - 1e-9 <= s[0] - before <= rise * gap_ms / 1e3 + 1e-9
        assert (np.diff(s) <= rise * STAGE_S + 1e-9).all()
        assert (np.diff(s) >= -config.release_per_s * STAGE_S - 1e-9).all()
        assert decision.reason
        before = decision.stiffening
