"""The centre's velocity: in body lengths, the same live and in training, and unknown is not moving."""

import numpy as np
import pytest
from anticipation_nets import STANDING, message, nobody

from anticipation.centre import FASTEST, SPAN_S, centre_velocity, path
from anticipation.training.clips import Clip
from anticipation.training.samples import clean
from anticipation.window import PoseWindow
from bridge.config.anticipation import AnticipationConfig
from bridge.config.perception import CleaningConfig
from bridge.messages import STEP_S


def window() -> PoseWindow:
    return PoseWindow(AnticipationConfig(), STANDING * 0.5)


def test_it_is_what_the_centre_does_in_a_fifth_of_a_second():
    velocity = centre_velocity(np.array([103.0, 50.0]), np.array([100.0, 52.0]), 60.0)
    np.testing.assert_allclose(velocity * 60.0 / SPAN_S * STEP_S, [3.0, -2.0])


def test_the_unknown_does_not_move_and_nothing_moves_faster_than_people_fall():
    centres = np.array([[np.nan, 1.0], [0.0, 0.0], [1e6, -1e6]])
    velocity = centre_velocity(centres, np.zeros((3, 2)), np.array([100.0, np.nan, 100.0]))
    np.testing.assert_array_equal(velocity, [[0, 0], [0, 0], [FASTEST, -FASTEST]])


def test_the_path_adds_the_velocities_up():
    velocity = centre_velocity(np.array([5.0, 2.0]), np.zeros(2), 80.0)
    np.testing.assert_allclose(path(np.tile(velocity, (3, 1)), 80.0), np.outer([1, 2, 3], [5.0, 2.0]))


def test_a_window_carries_it_and_a_new_person_starts_at_rest():
    poses = window()
    for tick in range(20):
        poses.push(message(tick, STANDING + np.array([0.0, 0.02 * tick])))
    np.testing.assert_allclose(poses.rows[:, 12], np.tile([0.0, 0.02 / STEP_S * SPAN_S], (15, 1)), rtol=1e-5)
    poses.reset()
    poses.push(message(40, STANDING - 3.0))
    np.testing.assert_array_equal(poses.rows[-1, 12], [0.0, 0.0])


@pytest.mark.parametrize("missing", [1, 3])
def test_through_a_short_gap_it_is_that_of_the_line(missing):
    poses = window()
    for tick in range(20):
        gone = 10 <= tick < 10 + missing
        poses.push(nobody(tick) if gone else message(tick, STANDING + np.array([0.01 * tick, 0.0])))
    np.testing.assert_allclose(poses.rows[:, 12], np.tile([0.01 / STEP_S * SPAN_S, 0.0], (15, 1)), rtol=1e-4)


def test_training_and_the_live_window_see_the_same():
    """One clip through both, with a person who wanders and sinks."""
    rng = np.random.default_rng(3)
    frames = 40
    way = np.cumsum(rng.normal(0, 1.5, (frames, 2)), axis=0) + np.arange(frames)[:, None] * [0.5, 1.0]
    points = STANDING[None] * 100 + way[:, None] + [160, 120]
    keypoints = np.concatenate([points, np.full((frames, 12, 1), 0.9)], axis=-1)
    track = clean(Clip("a", "a", keypoints, 30.0, None, 320, 240, "made", "none"), CleaningConfig())
    centres = track.frames[:, 12]
    assert np.abs(centres[20:]).max() > 0.05
    body = track.body_px
    poses = window()
    place = np.array([160.0, 120.0])
    for tick in range(frames):
        place = place + centres[tick] * body[tick] * STEP_S / SPAN_S
        where = track.poses[tick] * body[tick] + place
        poses.push(message(tick, position_px=where, body_length_px=body[tick]))
    np.testing.assert_allclose(poses.rows, track.frames[-15:], atol=1e-5)
