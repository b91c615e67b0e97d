"""Quality falls with what is missing, with company and with poses no one was trained on."""

import numpy as np
import pytest
from anticipation_nets import STANDING, pose_statistics, poses
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.quality import PoseStatistics, judge
from bridge.config.anticipation import QualityConfig
from bridge.messages import KeypointStatus

CONFIG = QualityConfig()
MEASURED = np.full((15, 12), KeypointStatus.MEASURED)
USUAL = np.full(15, 0.5)


def test_input_as_in_training_has_full_quality():
    strangeness = pose_statistics().strangeness(poses(15, seed=5))
    assert judge(CONFIG, MEASURED, strangeness, 1).total == 1.0


def test_about_three_training_poses_in_a_hundred_are_beyond_the_limit():
    assert 0.02 < (pose_statistics().strangeness(poses(500)) > 1).mean() < 0.07


@pytest.mark.parametrize(
    "skeleton",
    [
        np.zeros((12, 2)),  # all in one point
        STANDING[::-1],  # upside down, joints exchanged
        STANDING * [1, -1] * 2.5,
        np.random.default_rng(0).uniform(-1, 1, (12, 2)),
        STANDING + np.eye(12, 2) * 2,  # one joint far away
    ],
)
def test_what_is_no_person_is_strange(skeleton):
    strangeness = pose_statistics().strangeness(np.tile(skeleton, (15, 1, 1)))
    assert judge(CONFIG, MEASURED, strangeness, 1).total < 0.3


def test_the_cause_is_named():
    strange, lost = np.full(15, 2.3), np.full((15, 12), KeypointStatus.LOST)
    assert "unlike any seen" in judge(CONFIG, MEASURED, strange, 1).cause
    assert "too few keypoints" in judge(CONFIG, lost, USUAL, 1).cause
    assert "several people" in judge(CONFIG, MEASURED, USUAL, 2).cause


def test_a_skeleton_that_breaks_for_a_third_of_the_window_counts_at_once():
    broken = USUAL.copy()
    broken[4:9] = 3.0
    assert judge(CONFIG, MEASURED, broken, 1).total == 0.0
    broken[4:9] = USUAL[4:9]
    broken[4] = 3.0
    assert judge(CONFIG, MEASURED, broken, 1).total == 1.0  # one wrong tick is the detector's, not the person's


@given(st.integers(0, 180), st.integers(0, 180), st.floats(0, 10), st.integers(0, 4))
@settings(deadline=None, max_examples=60)
def test_less_seen_or_stranger_is_never_better(filled, lost, strangeness, people):
    status = np.full(180, KeypointStatus.MEASURED, dtype=np.uint8)
    status[:filled] = KeypointStatus.FILLED
    status[:lost] = KeypointStatus.LOST
    base = judge(CONFIG, status.reshape(15, 12), np.full(15, strangeness), people).total
    assert 0.0 <= base <= 1.0
    assert judge(CONFIG, status.reshape(15, 12), np.full(15, strangeness + 0.3), people).total <= base
    worse = status.copy()
    worse[: lost + 20] = KeypointStatus.LOST
    assert judge(CONFIG, worse.reshape(15, 12), np.full(15, strangeness), people).total <= base
    assert judge(CONFIG, status.reshape(15, 12), np.full(15, strangeness), people + 2).total <= base


def test_half_the_skeleton_lost_is_little_and_most_of_it_nothing():
    status = MEASURED.copy()
    status[:, :6] = KeypointStatus.LOST
    assert 0 < judge(CONFIG, status, USUAL, 1).total < 0.5
    status[:, :9] = KeypointStatus.LOST
    assert judge(CONFIG, status, USUAL, 1).total == 0


def test_outliers_in_the_training_poses_do_not_widen_what_counts_as_seen():
    clean = poses(1000)
    dirty = clean.copy()
    dirty[:10] = np.random.default_rng(1).uniform(-5, 5, (10, 12, 2))
    strange = np.random.default_rng(2).uniform(-1, 1, (50, 12, 2))
    one, other = PoseStatistics.fit(clean), PoseStatistics.fit(dirty)
    assert np.median(other.strangeness(strange) / one.strangeness(strange)) > 0.5


def test_too_few_poses_are_refused():
    with pytest.raises(ValueError, match="100"):
        PoseStatistics.fit(poses(50))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"measured_share_zero": 0.9, "measured_share_full": 0.8}, "measured_share_zero"),
        ({"strangeness_full": 5.0}, "strangeness_full"),
    ],
)
def test_thresholds_out_of_order_are_refused(keys, says):
    with pytest.raises(ValueError, match=says):
        QualityConfig(**keys)
