"""The detector's noise is what was measured between two real estimators."""

import numpy as np
import pytest

from anticipation.training import detector
from anticipation.training.detector import observe
from anticipation.training.detector_statistics import compare, measure

PERSON = np.array(
    [
        [-18, -50], [18, -50], [-24, -20], [24, -20], [-26, 8], [26, 8],
        [-12, 0], [12, 0], [-13, 45], [13, 45], [-14, 88], [14, 88],
    ],
    dtype=np.float64,
)  # fmt: skip


@pytest.fixture(scope="module")
def drawn():
    """What two drawn estimators say of sixty people who sway."""
    rng = np.random.default_rng(0)
    sway = 3.0 * np.sin(np.arange(150) / 20)[:, None, None]
    pairs = [[observe(PERSON + 150 + sway, rng) for _ in range(2)] for _ in range(60)]
    return compare([(one, other) for one, other in pairs])


def by_pair(values):
    return values.reshape(6, 2).mean(axis=1)


def test_two_drawn_estimators_differ_as_two_real_ones(drawn):
    assert np.allclose(by_pair(drawn.spread), detector.SPREAD, rtol=0.2)  # lapses of legs widen it by a sixth
    assert np.allclose(by_pair(drawn.misplaced), detector.MISPLACED, rtol=0.2, atol=0.006)
    assert np.allclose(by_pair(drawn.faint.mean(axis=0)), detector.FAINT, rtol=0.25)
    assert (drawn.jitter > detector.JITTER[0]).all()
    assert (drawn.jitter < detector.JITTER[1]).all()
    assert 0.0 < drawn.blind.mean() < detector.BLIND


def test_left_and_right_are_exchanged_as_often_as_measured(drawn):
    assert drawn.swapped[0] == 0.0
    assert np.allclose(drawn.swapped, detector.SWAPPED, rtol=0.4, atol=0.002)
    assert drawn.swapped[4] > 0.01


def test_an_exchange_is_found_where_there_is_one():
    track = np.concatenate([np.tile(PERSON, (100, 1, 1)), np.full((100, 12, 1), 0.9)], axis=-1)
    other = track.copy()
    other[:10, [8, 9]] = other[:10, [9, 8]]
    assert np.allclose(compare([(track, other)]).swapped, [0, 0, 0, 0, 0.1, 0])


def test_frames_in_which_one_found_nobody_are_not_compared():
    track = np.concatenate([np.tile(PERSON, (50, 1, 1)), np.full((50, 12, 1), 0.9)], axis=-1)
    blind = track.copy()
    blind[:5] = np.nan  # before it has begun: no failure
    blind[20:25] = np.nan
    found = compare([(track, blind)])
    assert found.frames == 40
    assert np.allclose(found.blind, [0, 5 / 45])
    with pytest.raises(ValueError, match="no frame"):
        compare([(track, np.full_like(track, np.nan))])


@pytest.mark.data
def test_the_constants_are_those_of_the_data(data_dir):
    found = measure(data_dir)
    assert found.frames > 1400
    assert np.allclose(by_pair(found.spread), detector.SPREAD, atol=0.002)
    assert np.allclose(by_pair(found.misplaced), detector.MISPLACED, atol=0.003)
    assert np.allclose(found.swapped, detector.SWAPPED, atol=0.002)
    assert np.allclose(by_pair(found.faint.mean(axis=0)), detector.FAINT, atol=0.003)
    assert np.allclose(found.jitter, detector.JITTER, atol=0.002)
    assert np.allclose(found.blind[0], detector.BLIND, atol=0.002)
