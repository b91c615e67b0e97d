"""Risk: monotone in every cue, bounded, and never lowered by not knowing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from controller_messages import MS, NS, horizon
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.intervention import InterventionConfig
from bridge.config.load import load_config
from bridge.config.supervisor import SupervisorConfig
from bridge.errors import ConfigError
from bridge.messages import STEP_S, STEPS
from controller.intervention.known_risk import KnownRisk
from controller.intervention.risk import assess_risk, describe, ramp, time_to_boundary

CONFIG = InterventionConfig(unconfirmed_most=1.0)  # one cue at a time
DEFAULTS = InterventionConfig()
NOW = np.zeros(1)

distances = st.floats(-1000, 1000)
rates = st.floats(-1e5, 1e5)
probabilities = st.floats(0, 1)


def total(distance: float = 5.0, rate: float = 0.0, fall: float = 0.0, config: InterventionConfig = CONFIG) -> float:
    return float(assess_risk(horizon(distance=distance, rate=rate, fall=fall), config).total[0])


class TestMonotone:
    @settings(max_examples=60, deadline=None)
    @given(distances, distances, rates, probabilities)
    def test_nearer_is_never_less(self, a: float, b: float, rate: float, fall: float) -> None:
        assert total(min(a, b), rate, fall) >= total(max(a, b), rate, fall)

    @settings(max_examples=60, deadline=None)
    @given(distances, rates, rates, probabilities)
    def test_faster_closing_is_never_less(self, distance: float, a: float, b: float, fall: float) -> None:
        assert total(distance, min(a, b), fall) >= total(distance, max(a, b), fall)

    @settings(max_examples=60, deadline=None)
    @given(distances, rates, probabilities, probabilities)
    def test_more_probable_is_never_less(self, distance: float, rate: float, a: float, b: float) -> None:
        assert total(distance, rate, max(a, b)) >= total(distance, rate, min(a, b))

    @settings(max_examples=60, deadline=None)
    @given(distances, rates, probabilities)
    def test_within_zero_and_one(self, distance: float, rate: float, fall: float) -> None:
        assert 0.0 <= total(distance, rate, fall) <= 1.0


class TestDefaults:
    def test_steady_walking_has_no_risk(self) -> None:
        for distance in (3.0, 4.5, 6.0):
            assert total(distance, rate=-1.0, fall=0.05) == 0.0

    def test_swaying_far_from_the_boundary_has_no_risk(self) -> None:
        assert total(4.0, rate=-30.0) == 0.0

    def test_lying_has_full_risk(self) -> None:
        assert total(-1.0) == 1.0
        assert total(5.0, fall=0.95) == 1.0

    def test_racing_towards_the_boundary_is_a_risk_before_it_is_near(self) -> None:
        assert total(2.0, rate=-10.0) > 0.8
        assert total(2.0, rate=0.0) == 0.0

    def test_unknown_keeps_guard(self) -> None:
        assert CONFIG.unknown_risk >= SupervisorConfig().guard_on
        assert CONFIG.unknown_risk < SupervisorConfig().arrest_on


class TestAgreement:
    def risk(self, transient: float, fall: float = 0.0, last: float | None = None) -> float:
        falls = np.full(STEPS, fall)
        falls[-1] = fall if last is None else last
        seen = horizon(distance=-1.0, rate=-5.0, fall=falls, transient=np.minimum(transient, 1.0 - falls))
        return float(assess_risk(seen, DEFAULTS).total[0])

    def test_whom_the_classifier_calls_stable_is_not_at_risk_for_bending_down(self) -> None:
        assert self.risk(transient=0.0) == 0.0
        assert self.risk(transient=DEFAULTS.credible_onset) == pytest.approx(0.0)
        assert 0.0 < self.risk(transient=0.5) < self.risk(transient=0.55) < DEFAULTS.unconfirmed_most

    def test_without_a_foreseen_fall_there_is_no_arrest(self) -> None:
        assert self.risk(transient=1.0) == DEFAULTS.unconfirmed_most < SupervisorConfig().arrest_on
        assert self.risk(transient=1.0) >= SupervisorConfig().guard_on

    def test_a_fall_foreseen_anywhere_in_the_horizon_confirms(self) -> None:
        assert self.risk(transient=1.0, last=DEFAULTS.probability_full) == pytest.approx(1.0)
        half = 0.5 * (DEFAULTS.probability_onset + DEFAULTS.probability_full)
        assert self.risk(transient=1.0, last=half) == pytest.approx(DEFAULTS.unconfirmed_most)


class TestCues:
    def test_thresholds_are_where_they_say(self) -> None:
        assert total(CONFIG.distance_onset_sd) == 0.0
        assert total(CONFIG.distance_full_sd) == 1.0
        assert total(0.5 * (CONFIG.distance_onset_sd + CONFIG.distance_full_sd)) == pytest.approx(0.5)
        assert total(fall=CONFIG.probability_onset) == 0.0
        assert total(fall=CONFIG.probability_full) == pytest.approx(1.0)
        assert total(fall=0.5 * (CONFIG.probability_onset + CONFIG.probability_full)) == pytest.approx(0.5)

    def test_approach(self) -> None:
        near = CONFIG.approach_near_sd
        at_onset, at_full = -near / CONFIG.approach_onset_s, -near / CONFIG.approach_full_s
        assert total(near, at_onset) == pytest.approx(0.0)
        assert total(near, at_full) == pytest.approx(1.0)
        assert total(CONFIG.approach_far_sd, -1e4) == 0.0

    def test_each_step_is_judged_alone(self) -> None:
        distance = np.linspace(5.0, -2.0, STEPS)
        risk = assess_risk(horizon(distance=distance), CONFIG)
        assert risk.total[0] == 0.0
        assert risk.total[-1] == 1.0
        assert (np.diff(risk.total) >= 0.0).all()

    def test_ramp_in_both_directions(self) -> None:
        values = np.array([-1.0, 0.0, 1.0, 2.0, 3.0])
        assert ramp(values, 0.0, 2.0).tolist() == [0.0, 0.0, 0.5, 1.0, 1.0]
        assert ramp(values, 2.0, 0.0).tolist() == [1.0, 1.0, 0.5, 0.0, 0.0]

    def test_time_to_boundary(self) -> None:
        times = time_to_boundary(np.array([2.0, 2.0, 0.0, -1.0, 1.0]), np.array([-4.0, 4.0, 3.0, -2.0, 0.0]))
        assert times.tolist() == [0.5, math.inf, 0.0, 0.0, math.inf]


class TestConfig:
    @pytest.mark.parametrize(
        ("setting", "words"),
        [
            ("intervention.distance_full_sd=2.0", "distance_full_sd = 2 must be below distance_onset_sd = 1.5"),
            ("intervention.approach_full_s=0.8", "approach_full_s = 0.8 must be below approach_onset_s = 0.8"),
            ("intervention.approach_near_sd=4", "approach_near_sd = 4 must be below approach_far_sd = 3.5"),
            ("intervention.probability_full=0.1", "probability_onset = 0.2 must be below probability_full = 0.1"),
            ("intervention.release_per_s=9", "release_per_s = 9 must be below rise_per_s = 8"),
            ("supervisor.guard_off=0.25", "guard_off = 0.25 must be below guard_on = 0.25"),
            ("supervisor.arrest_off=0.9", "arrest_off = 0.9 must be below arrest_on = 0.8"),
            ("gate.column_low_m=1.3", "column_low_m = 1.3 must be below column_high_m = 1.2"),
            ("intervention.unknown_risk=1.5", "intervention.unknown_risk = 1.5"),
        ],
    )
    def test_contradictions_name_key_and_value(self, setting: str, words: str) -> None:
        with pytest.raises(ConfigError, match=words.replace(".", r"\.")):
            load_config(None, [setting])

    def test_equal_rates_are_fine(self) -> None:
        assert InterventionConfig(release_per_s=8.0, rise_per_s=8.0, arrest_per_s=8.0).rise_per_s == 8.0


class TestWords:
    def say(self, step: int = 0, ahead_s: float = 0.0, **changes: Any) -> str:
        given_horizon = horizon(**changes)
        return describe(given_horizon, assess_risk(given_horizon, CONFIG), step, ahead_s)

    def test_distance_and_approach(self) -> None:
        assert self.say(distance=0.4, rate=-3.1) == "fall boundary 0.4 sd away, closing at 3.1 sd/s, 129 ms"
        assert self.say(distance=0.4, rate=2.0) == "fall boundary 0.4 sd away"
        assert self.say(distance=-0.8) == "0.8 sd past the fall boundary"

    def test_probability(self) -> None:
        assert self.say(fall=0.72) == "fall probability 0.72"

    def test_foreseen(self) -> None:
        words = self.say(step=6, ahead_s=0.2, distance=1.0)
        assert words == "fall boundary 1.0 sd away (foreseen in 200 ms)"


class TestKnownRisk:
    def make(self, **changes: Any) -> KnownRisk:
        return KnownRisk(InterventionConfig(**{"unconfirmed_most": 1.0, **changes}))

    def test_nothing_known_yet(self) -> None:
        known = self.make()
        assert known.ahead(NS, NOW)[0] == CONFIG.unknown_risk
        assert known.words(NS, 0.0, 1.0) == "no horizon yet"

    def test_shifted_by_its_age_and_held_past_its_end(self) -> None:
        known = self.make()
        fall = np.linspace(0.0, 1.0, STEPS)
        known.update(horizon(fall=fall), NS)
        expected = assess_risk(horizon(fall=fall), CONFIG).total
        ahead = np.arange(STEPS) * STEP_S
        np.testing.assert_allclose(known.ahead(NS, ahead), expected, atol=1e-12)
        later = known.ahead(NS + round(3 * STEP_S * NS), ahead)
        np.testing.assert_allclose(later[:-3], expected[3:], atol=1e-6)
        assert (later[-3:] == expected[-1]).all()
        assert known.ahead(NS - NS // 10, NOW)[0] == expected[0]

    @settings(max_examples=60, deadline=None)
    @given(
        st.lists(st.tuples(st.floats(-3, 8), st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=20),
        st.floats(0, 0.5),
    )
    def test_low_quality_never_lowers_the_risk(
        self, sequence: list[tuple[float, float, float]], ahead_s: float
    ) -> None:
        """The same horizons, once trusted and once not: what is not trusted adds and takes nothing away."""
        known, trusted_only = self.make(), self.make()
        ahead = np.array([ahead_s])
        for k, (distance, fall, quality) in enumerate(sequence):
            now_ns = NS + k * 20 * MS
            given_horizon = horizon(now_ns, distance=distance, fall=fall, quality=quality)
            known.update(given_horizon, now_ns)
            if quality >= CONFIG.trusted_quality:
                trusted_only.update(given_horizon, now_ns)
            own = float(assess_risk(given_horizon, CONFIG).total[0])
            assert known.ahead(now_ns, ahead)[0] >= own - 1e-12
            if trusted_only._newest is not None and now_ns - trusted_only._newest.start_ns <= 0.5 * NS:
                assert known.ahead(now_ns, ahead)[0] >= trusted_only.ahead(now_ns, ahead)[0] - 1e-12
            else:
                assert known.ahead(now_ns, ahead)[0] >= CONFIG.unknown_risk

    def test_memory_is_limited_then_the_floor_holds(self) -> None:
        known = self.make(unknown_hold_s=0.5)
        known.update(horizon(fall=0.9), NS)
        late = NS + 400 * MS
        known.update(horizon(late, quality=0.2), late)
        assert known.ahead(NS + 500 * MS, NOW)[0] == 1.0
        assert known.ahead(NS + 500 * MS + 1, NOW)[0] == CONFIG.unknown_risk
        assert "quality 0.20, limit 0.50" in known.words(NS + 600 * MS, 0.0, CONFIG.unknown_risk)

    def test_trust_returns_at_its_threshold(self) -> None:
        known = self.make()
        known.update(horizon(quality=0.49), NS)
        assert known.ahead(NS, NOW)[0] == CONFIG.unknown_risk
        known.update(horizon(NS + MS, quality=0.5), NS + MS)
        assert known.ahead(NS + MS, NOW)[0] == 0.0

    def test_untrusted_alarm_is_still_an_alarm(self) -> None:
        known = self.make()
        known.update(horizon(fall=0.9, quality=0.1), NS)
        assert known.ahead(NS, NOW)[0] == 1.0
        assert known.words(NS, 0.0, 1.0) == "fall probability 0.90"

    def test_an_untrusted_alarm_alone_guards_and_does_not_arrest(self) -> None:
        known = KnownRisk(DEFAULTS)
        known.update(horizon(fall=1.0, quality=0.49), NS)
        assert SupervisorConfig().guard_on < known.ahead(NS, NOW)[0] == DEFAULTS.unconfirmed_most
        known.update(horizon(NS + MS, fall=1.0, quality=0.5), NS + MS)
        assert known.ahead(NS + MS, NOW)[0] == 1.0

    def test_reconfigure_judges_the_newest_horizon_again(self) -> None:
        known = self.make()
        known.reconfigure(CONFIG)
        known.update(horizon(fall=0.5), NS)
        before = known.ahead(NS, NOW)[0]
        known.reconfigure(InterventionConfig(probability_onset=0.1, probability_full=0.5))
        assert before < known.ahead(NS, NOW)[0] == 1.0

    def test_who_looks_further_ahead_sees_what_was_there_all_along(self) -> None:
        known = self.make(steps_used=1)
        known.update(horizon(fall=np.linspace(0.0, 1.0, STEPS)), NS)
        end = np.array([(STEPS - 1) * STEP_S])
        assert known.ahead(NS, end)[0] == 0.0
        known.reconfigure(CONFIG)
        assert known.ahead(NS, end)[0] == 1.0
