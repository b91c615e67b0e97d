"""The stiffening profile: bounded, rate-limited, in time for what is foreseen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.intervention.stiffening import Rates, stiffening_profile

RATES = Rates(rise=8.0, release=1.0)
STAGES, STAGE_S = 20, 0.025

levels = st.floats(0.0, 1.0)
asked_profiles = st.lists(levels, min_size=STAGES, max_size=STAGES).map(np.array)
rates = st.tuples(st.floats(0.1, 50.0), st.floats(0.1, 50.0)).map(lambda r: Rates(*r))


def profile(present: float, asked: np.ndarray, elapsed_s: float = 0.01, rates: Rates = RATES) -> np.ndarray:
    return stiffening_profile(present, asked, elapsed_s, STAGE_S, rates)


@settings(max_examples=60, deadline=None)
@given(levels, asked_profiles, st.floats(0.0, 0.5), rates)
def test_bounded_and_rate_limited(present: float, asked: np.ndarray, elapsed_s: float, rates: Rates) -> None:
    s = profile(present, asked, elapsed_s, rates)
    assert ((s >= 0.0) & (s <= 1.0)).all()
    assert -rates.release * elapsed_s - 1e-12 <= s[0] - present <= rates.rise * elapsed_s + 1e-12
    steps = np.diff(s)
    assert (steps <= rates.rise * STAGE_S + 1e-12).all()
    assert (steps >= -rates.release * STAGE_S - 1e-12).all()


@settings(max_examples=60, deadline=None)
@given(levels, asked_profiles, st.integers(0, STAGES - 1), levels)
def test_asking_for_more_never_gives_less(present: float, asked: np.ndarray, stage: int, more: float) -> None:
    raised = asked.copy()
    raised[stage] = max(raised[stage], more)
    assert (profile(present, raised) >= profile(present, asked) - 1e-12).all()


@settings(max_examples=60, deadline=None)
@given(levels, asked_profiles, st.integers(0, STAGES), st.floats(0.0, 0.1))
def test_what_comes_earlier_never_gives_a_softer_present(
    present: float, asked: np.ndarray, sooner: int, elapsed_s: float
) -> None:
    """The same rise, some stages earlier: nothing in the profile is softer for it, the present least of all."""
    rising = np.sort(asked)
    earlier = np.concatenate([rising[sooner:], np.full(sooner, rising[-1])])
    assert (profile(present, earlier, elapsed_s) >= profile(present, rising, elapsed_s) - 1e-12).all()


@settings(max_examples=100, deadline=None)
@given(asked_profiles)
def test_never_less_than_asked_once_it_could_rise(asked: np.ndarray) -> None:
    s = profile(1.0, asked)
    assert (s >= asked - 1e-12).all()


def test_foreseen_risk_stiffens_the_prediction_before_the_present() -> None:
    asked = np.zeros(STAGES)
    asked[12:] = 1.0  # 300 ms ahead
    s = profile(0.0, asked)
    assert s[0] == 0.0
    assert s[12] == pytest.approx(1.0)
    assert 0.0 < s[11] < 1.0


def test_present_rises_in_time_as_the_foreseen_moment_comes_nearer() -> None:
    """A step of risk 300 ms ahead: the present rises over the last 125 ms and is stiff when it comes."""
    s, history = 0.0, []
    for k in range(31):
        ahead_s = np.arange(STAGES) * STAGE_S
        asked = (ahead_s >= 0.3 - k * 0.01 - 1e-9).astype(float)
        s = float(profile(s, asked)[0])
        history.append(s)
    assert max(history[:15]) == 0.0
    assert history[30] >= 1.0 - 8.0 * STAGE_S  # the stages see a step no finer than that
    assert np.diff(history).max() <= 8.0 * 0.01 + 1e-12


def test_releases_slowly() -> None:
    s = profile(1.0, np.zeros(STAGES), elapsed_s=0.1)
    assert s[0] == pytest.approx(0.9)
    assert s[-1] == pytest.approx(0.9 - 19 * STAGE_S)


def test_no_time_no_change() -> None:
    assert profile(0.3, np.ones(STAGES), elapsed_s=0.0)[0] == 0.3
    assert profile(0.3, np.ones(STAGES), elapsed_s=-5.0)[0] == 0.3


def test_read_only_and_a_value_of_its_own() -> None:
    asked = np.ones(STAGES)
    s = profile(0.0, asked)
    assert not s.flags.writeable
    assert (asked == 1.0).all()


def test_one_stage() -> None:
    assert stiffening_profile(0.0, np.ones(1), 0.05, STAGE_S, RATES).tolist() == pytest.approx([0.4])
