"""What counts as a fall caught, as a lead, and as a needless intervention."""

from __future__ import annotations

import math

import numpy as np
import pytest
from controller_tuning_streams import run_of

from bridge.messages import GaitState
from controller.tuning.cases import Fall
from controller.tuning.score import EARLY_S, Intervening, score, score_one

FOLLOW, GUARD, ARREST, RECOVER, STOP = (
    GaitState.FOLLOW, GaitState.GUARD, GaitState.ARREST, GaitState.RECOVER, GaitState.SAFE_STOP,
)  # fmt: skip
FALL = (Fall(4.0, 5.0, 7.0),)


def test_an_arrest_before_the_impact_catches_and_leads() -> None:
    outcome = score([run_of([(4.7, ARREST)], 8.0, FALL)])
    assert (outcome.falls, outcome.caught, outcome.needless) == (1, 1, 0)
    assert outcome.lead_median_s == pytest.approx(0.3)


def test_an_arrest_after_the_impact_is_late() -> None:
    (fall,) = score_one(run_of([(5.2, ARREST)], 8.0, FALL)).falls
    assert not fall.caught
    assert fall.late_s == pytest.approx(0.2)
    assert math.isnan(fall.lead_s)


def test_who_is_let_go_before_the_impact_is_not_caught() -> None:
    outcome = score([run_of([(4.2, ARREST), (4.5, RECOVER), (4.8, FOLLOW)], 8.0, FALL)])
    assert outcome.caught == 0
    assert score([run_of([(4.2, ARREST), (4.8, STOP)], 8.0, FALL)]).caught == 1  # a stop holds what it has


def test_the_lead_counts_from_the_arrest_that_holds() -> None:
    run = run_of([(4.1, ARREST), (4.3, RECOVER), (4.5, FOLLOW), (4.6, ARREST)], 8.0, FALL)
    assert score([run]).leads_s == pytest.approx((0.4,))


def test_an_arrest_long_before_is_needless_even_if_it_lasts() -> None:
    outcome = score([run_of([(1.0, ARREST)], 8.0, FALL)])
    assert (outcome.caught, outcome.needless) == (1, 1)
    assert outcome.lead_median_s == pytest.approx(1.0 + EARLY_S)  # counted from where it is about the fall
    assert score([run_of([(4.0 - 0.9 * EARLY_S, ARREST)], 8.0, FALL)]).needless == 0


def test_every_entry_outside_a_fall_is_needless_and_while_lying_none_is() -> None:
    spans = [(1.0, ARREST), (2.0, FOLLOW), (3.0, ARREST), (3.2, FOLLOW), (6.0, ARREST), (6.5, FOLLOW), (7.5, ARREST)]
    tally = score_one(run_of(spans, 9.0, FALL))
    assert tally.needless_s == pytest.approx((1.0, 3.0, 7.5))


def test_time_is_counted_while_watching_and_outside_falls() -> None:
    run = run_of([(0.0, GaitState.DISARMED), (1.0, FOLLOW), (2.0, STOP), (2.5, FOLLOW)], 9.0, FALL)
    assert score([run]).hours * 3600 == pytest.approx(9.0 - 1.0 - 0.5 - (3.0 + EARLY_S), abs=0.02)


def test_guard_counts_where_it_is_asked_for() -> None:
    run = run_of([(1.0, GUARD), (2.0, FOLLOW), (4.4, GUARD), (4.8, ARREST)], 8.0, FALL)
    by_arrest, by_guard = score([run]), score([run], Intervening.GUARD)
    assert (by_arrest.needless, by_guard.needless) == (0, 1)
    assert by_arrest.lead_median_s == pytest.approx(0.2)
    assert by_guard.lead_median_s == pytest.approx(0.6)


def test_a_fall_before_anything_was_armed_is_missed_and_said() -> None:
    outcome = score([run_of([(0.0, GaitState.DISARMED), (5.5, FOLLOW)], 8.0, FALL)])
    assert (outcome.falls, outcome.caught, outcome.unwatched) == (1, 0, 1)


def test_nothing_to_count_is_no_number() -> None:
    outcome = score([run_of([], 8.0)])
    assert math.isnan(outcome.caught_share)
    assert math.isnan(outcome.lead_median_s)
    assert outcome.per_hour == 0.0
    assert math.isnan(score([]).per_hour)


def test_several_recordings_add_up() -> None:
    runs = [run_of([(4.7, ARREST)], 8.0, FALL), run_of([(1.0, ARREST)], 8.0), run_of([(4.5, ARREST)], 8.0, FALL)]
    outcome = score(runs)
    assert (outcome.falls, outcome.caught, outcome.needless) == (2, 2, 1)
    assert outcome.lead_median_s == pytest.approx(np.median([0.3, 0.5]))
