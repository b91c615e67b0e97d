"""Temperatures and calibration error, against cases worked out by hand and against what must always hold."""

import numpy as np
import pytest
from anticipation_records import clip_of, seen
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.training.evaluation.calibration import (
    ahead,
    cross_fitted,
    expected_error,
    fitted,
    reliability,
    said,
    tempered,
)
from anticipation.training.evaluation.records import Record


def spread_over_steps(probabilities, labels):
    """The same predictions at each of the 16 steps."""
    return np.repeat(probabilities[:, None], 16, axis=1), np.repeat(labels[:, None], 16, axis=1)


def test_error_of_ten_predictions_by_hand():
    """Six at 0.95, of which four come true; four at 0.55, of which three do."""
    sure, unsure = [0.95, 0.03, 0.02], [0.3, 0.55, 0.15]
    probabilities = np.array([sure] * 6 + [unsure] * 4)
    labels = np.array([0, 0, 0, 0, 1, 2, 1, 1, 1, 0])
    expected = 0.6 * abs(0.95 - 4 / 6) + 0.4 * abs(0.55 - 3 / 4)
    assert expected_error(*spread_over_steps(probabilities, labels)) == pytest.approx(np.full(16, expected))
    assert [(each.size, each.confidence, each.accuracy) for each in reliability(probabilities, labels)] == [
        (4, pytest.approx(0.55), pytest.approx(3 / 4)),
        (6, pytest.approx(0.95), pytest.approx(4 / 6)),
    ]


def test_unknown_labels_count_nowhere():
    probabilities, labels = spread_over_steps(np.array([[0.9, 0.05, 0.05]] * 4), np.array([0, 0, -100, -100]))
    assert expected_error(probabilities, labels) == pytest.approx(np.full(16, 0.1))
    assert np.isnan(expected_error(probabilities, np.full_like(labels, -100))).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0.3, 4.0))
def test_tempering_keeps_the_order_and_is_undone_by_its_inverse(seed, temperature):
    probabilities = np.random.default_rng(seed).dirichlet(np.ones(3), (5, 16))
    there = tempered(probabilities, np.full(16, temperature))
    assert there.sum(axis=-1) == pytest.approx(np.ones((5, 16)))
    assert (there.argmax(axis=-1) == probabilities.argmax(axis=-1)).all()
    assert tempered(there, np.full(16, 1 / temperature)) == pytest.approx(probabilities, abs=1e-6)
    softer = tempered(probabilities, np.full(16, 2 * temperature)).max(axis=-1)
    assert (softer <= there.max(axis=-1) + 1e-12).all()


def test_a_probability_of_zero_stays_one():
    assert np.isfinite(tempered(np.array([[[1.0, 0.0, 0.0]] * 16]), np.full(16, 2.0))).all()


def overconfident(seed, part):
    """A fall whose network says 0.99 and errs at a third of the steps."""
    clip = clip_of(seed)
    return Record(clip.name, clip.group, "URFD", "fall", part, seen(clip, confidence=0.99, wrong=1 / 3, seed=seed))


def test_temperature_of_a_part_comes_from_the_others_and_mends_it():
    records = [overconfident(seed, seed % 2) for seed in range(6)]
    first, second = cross_fitted(records, 2, "alphapose")
    assert (first > 1.5).all()
    mine = said([record for record in records if record.part == 0])
    before = expected_error(mine.probabilities, mine.labels)
    assert expected_error(tempered(mine.probabilities, first), mine.labels).mean() < 0.5 * before.mean()
    perfect = clip_of(0)
    records[0] = Record(perfect.name, perfect.group, "URFD", "fall", 0, seen(perfect, confidence=0.99))
    changed = cross_fitted(records, 2, "alphapose")
    assert (changed[0] == first).all()  # what part 0 says does not move its own temperature
    assert (changed[1] < second).any()


def test_temperatures_without_anything_to_fit_are_one():
    assert (fitted(said([])) == 1).all()
    assert (cross_fitted([overconfident(0, 0)], 1, "alphapose")[0] == 1).all()


def test_labels_ahead():
    rows = ahead(np.arange(20))
    assert rows.shape == (20, 16)
    assert rows[3].tolist() == list(range(3, 19))
    assert rows[18].tolist() == [18, 19] + [-100] * 14
