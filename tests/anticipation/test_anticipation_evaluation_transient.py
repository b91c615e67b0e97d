"""The distance to the fall boundary over the last second of a fall."""

import numpy as np
import pytest
from anticipation_records import made_predictions
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.training.evaluation.transient import correlation, descents

EVERYWHERE = np.ones(90, dtype=bool)
LYING = 60


def test_one_where_it_shrinks_at_every_tick_and_minus_one_where_it_grows():
    shrinking = np.linspace(5, -3, 90)
    assert correlation(shrinking, LYING, EVERYWHERE) == pytest.approx(1)
    assert correlation(-shrinking, LYING, EVERYWHERE) == pytest.approx(-1)


def test_only_the_last_second_counts():
    distance = np.linspace(5, -3, 90)
    distance[: LYING - 30] = np.random.default_rng(0).normal(size=LYING - 30)
    distance[LYING:] = 9.0
    assert correlation(distance, LYING, EVERYWHERE) == pytest.approx(1)


def test_what_cannot_be_judged_is_not_a_number():
    distance = np.linspace(5, -3, 90)
    few = np.zeros(90, dtype=bool)
    few[LYING - 7 : LYING] = True
    assert np.isnan(correlation(distance, LYING, few))
    assert np.isnan(correlation(np.zeros(90), LYING, EVERYWHERE))
    assert np.isnan(correlation(distance, 0, EVERYWHERE))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_it_does_not_change_when_distances_are_stretched(seed):
    distance = np.random.default_rng(seed).normal(size=90)
    stretched = np.exp(2 * distance) - 7
    assert correlation(distance, LYING, EVERYWHERE) == pytest.approx(correlation(stretched, LYING, EVERYWHERE))


def test_planes_side_by_side():
    predictions = made_predictions(wrong=0.0)
    rows = {each.name: each for each in descents(predictions, predictions.of("fall", estimator="alphapose"))}
    assert set(rows) == {"as shipped", "PCA, window"}
    for each in rows.values():
        assert each.median == pytest.approx(1)
        assert each.share == 1
        assert len(each.correlations) == 4
    assert rows["PCA, window"].accuracy == 1  # its region is the label
    assert rows["as shipped"].accuracy < 1  # two regions only, on either side of lying
    assert rows["as shipped"].classifier == 1
