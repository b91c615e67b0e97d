"""Falls foreseen, needless interventions and their intervals, against cases worked out by hand."""

import numpy as np
import pytest
from anticipation_records import alarmed, clip_of, frames, seen
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.training.evaluation.events import (
    calm,
    counted,
    fall_of,
    interventions,
    rate_interval,
    share_interval,
    together,
)
from anticipation.training.evaluation.records import Record

LABELS = [0] * 60 + [1] * 30 + [2] * 30  # stands two seconds, falls one, lies one
STATES = ("DISARMED", "FOLLOW", "GUARD", "ARREST", "RECOVER", "SAFE_STOP")


def fall(watched, ticks=None):
    found = fall_of(Record("fall-01/alphapose", "g", "URFD", "fall", 0, ticks, watched))
    assert found is not None
    return found


def test_a_fall_foreseen_in_time():
    found = fall(alarmed(LABELS, 72))
    assert found.foreseen
    assert (found.onset, found.first_alarm, found.first_arrest) == pytest.approx((1.0, 0.6, 0.6 - 1 / 3), abs=1e-6)


@pytest.mark.parametrize(("at", "early", "lead"), [(59, True, 31 / 30), (90, False, 0.0), (100, False, -1 / 3)])
def test_an_alarm_before_the_onset_or_after_the_fall_does_not_count(at, early, lead):
    found = fall(alarmed(LABELS, at))
    assert not found.foreseen
    assert found.early is early
    assert found.first_alarm == pytest.approx(lead, abs=1e-6)


def test_no_alarm_at_all():
    found = fall(frames(LABELS, ["FOLLOW"] * 120))
    assert not found.foreseen
    assert np.isnan(found.first_alarm)
    nobody_lies = Record("a", "g", "URFD", "fall", 0, None, frames([0] * 30, ["FOLLOW"] * 30))
    assert fall_of(nobody_lies) is None


def test_an_alarm_between_the_two_onsets_is_early_by_one_of_them_only():
    clip = clip_of(0)
    begun = int(np.argmax(clip.labels == 1))
    found = fall(alarmed(clip.labels, begun + 1), seen(clip))
    assert found.physical_onset < found.onset
    assert found.early_physical
    assert not found.early


def test_falls_together():
    some = together([fall(alarmed(LABELS, at)) for at in (60, 69, 78, 59, 95)])
    assert (some.falls, some.foreseen, some.early, some.late) == (5, 3, 1, 1)
    assert some.share == pytest.approx(0.6)
    assert some.median_lead == pytest.approx(0.7, abs=1e-6)
    assert some.fifth_percentile_lead == pytest.approx(0.43, abs=1e-6)
    assert np.isnan(together([]).median_lead)


def test_intervals_from_tables():
    """Garwood's limits for 0, 1 and 10 events; Clopper and Pearson's for 0 and 9 of 10."""
    assert rate_interval(0, 1.0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert rate_interval(1, 1.0) == pytest.approx((0.0253, 5.572), abs=1e-3)
    assert rate_interval(10, 2.0) == pytest.approx((4.795 / 2, 18.390 / 2), abs=1e-3)
    assert share_interval(0, 10) == pytest.approx((0.0, 0.3085), abs=1e-4)
    assert share_interval(9, 10) == pytest.approx((0.5550, 0.9975), abs=1e-4)
    assert rate_interval(3, 0.0) == (0.0, np.inf)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 60), st.floats(0.01, 20.0))
def test_an_interval_holds_the_rate_and_shrinks_with_time(count, hours):
    low, high = rate_interval(count, hours)
    assert low <= count / hours <= high
    longer = rate_interval(10 * count, 10 * hours)
    assert longer[1] - longer[0] < high - low


@pytest.mark.parametrize(
    ("states", "count"),
    [
        ("F F G G F F", 1),
        ("F G A A R R F G F", 2),
        ("G A R A R F", 1),  # once until the walker is free again
        ("F F S S F", 0),
        ("A", 1),
        ("D F", 0),
    ],
)
def test_counting_interventions(states, count):
    names = {name[0]: name for name in STATES}
    assert interventions(np.array([names[each] for each in states.split()])) == count


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from(STATES), max_size=40))
def test_no_more_interventions_than_guarded_frames_and_one_if_there_are_any(states):
    guarded = sum(state in {"GUARD", "ARREST"} for state in states)
    count = interventions(np.array(states, dtype="<U9"))
    assert min(guarded, 1) <= count <= guarded


def test_daily_life_by_activity():
    quiet, loud = frames([0] * 900, ["FOLLOW"] * 900), alarmed([0] * 900, 500)
    stopped = frames([0] * 900, ["FOLLOW"] * 450 + ["SAFE_STOP"] * 450)
    named = [("activity06-trial1-cam1", quiet), ("activity06-trial2-cam1", loud), ("activity08-trial1-cam1", stopped)]
    rows = {
        each.activity: each
        for each in calm([Record(name, "g", "UP-Fall", "daily", 0, None, each) for name, each in named])
    }
    walking, sitting = rows["UP-Fall walking"], rows["UP-Fall sitting"]
    assert (walking.clips, walking.clips_with_any, walking.clips_with_arrest, walking.interventions) == (2, 1, 1, 1)
    assert walking.hours == pytest.approx(60 / 3600)
    assert walking.per_hour == pytest.approx(60)
    assert (sitting.clips_with_any, sitting.clips_stopped) == (0, 1)
    assert counted("none", []).clips == 0
