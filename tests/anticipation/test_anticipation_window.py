"""The window of poses: gaps, losses and new starts."""

import numpy as np
import pytest
from anticipation_nets import STANDING, lost, message, nobody

from anticipation.window import PoseWindow
from bridge.config.anticipation import AnticipationConfig
from bridge.messages import KeypointStatus

MEAN = STANDING * 0.5
SWAY = 0.01 * np.array([1.0, -0.5])


def moving(tick: int) -> np.ndarray:
    """Arms that move evenly while the trunk stands still."""
    pose = np.array(STANDING)
    pose[2:6] += tick * SWAY
    return pose


def window(**changes) -> PoseWindow:
    return PoseWindow(AnticipationConfig(**changes), MEAN)


def filled(ticks, **changes) -> PoseWindow:
    poses = window(**changes)
    for tick in ticks:
        poses.push(message(tick, moving(tick)))
    return poses


def test_fifteen_ticks_make_a_window():
    poses = window()
    for tick in range(20):
        assert poses.full == (tick >= 15)
        poses.push(message(tick, moving(tick)))
        assert poses.frames == min(tick + 1, 15)
    np.testing.assert_allclose(poses.relative, [moving(tick) for tick in range(5, 20)], atol=1e-6)
    assert (poses.status == KeypointStatus.MEASURED).all()
    np.testing.assert_allclose(poses.centre_px, np.tile([160.0, 120.0], (15, 1)))


def test_place_and_size_in_the_image_do_not_matter():
    near, far = window(), window()
    for tick in range(15):
        near.push(message(tick, moving(tick)))
        far.push(message(tick, position_px=moving(tick) * 37 + (20, 300), body_length_px=37.0))
    np.testing.assert_allclose(near.relative, far.relative, atol=1e-6)


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_a_short_gap_is_filled_on_the_line(missing):
    whole = filled(range(20))
    gap = filled([tick for tick in range(20) if not 10 <= tick < 10 + missing])
    assert gap.full
    np.testing.assert_allclose(gap.relative, whole.relative, atol=1e-6)
    np.testing.assert_allclose(gap.centre_px, whole.centre_px, atol=1e-6)
    filled_rows = (gap.status == KeypointStatus.FILLED).all(axis=1)
    assert filled_rows.nonzero()[0].tolist() == list(range(5, 5 + missing))


def test_a_long_gap_starts_the_window_anew():
    poses = filled([*range(15), 19])
    assert poses.frames == 1
    for tick in range(20, 34):
        poses.push(message(tick, moving(tick)))
    assert poses.full
    np.testing.assert_allclose(poses.relative, [moving(tick) for tick in range(19, 34)], atol=1e-6)


def test_no_gap_is_allowed_where_the_limit_is_zero():
    assert filled([*range(15), 16], max_gap_s=0.0).frames == 1
    assert filled([*range(15), 15], max_gap_s=0.0).full


def test_a_jittering_clock_is_no_gap():
    random = np.random.default_rng(0)
    poses = window()
    for tick in range(30):
        late = int(random.integers(-8_000_000, 8_000_000))
        poses.push(message(tick, moving(tick), stamp_ns=message(tick).stamp_ns + late))
    assert poses.full
    assert (poses.status == KeypointStatus.MEASURED).all()


def test_old_and_repeated_ticks_are_ignored():
    poses = filled(range(15))
    before = poses.relative.copy()
    poses.push(message(14, STANDING * 2))
    poses.push(message(3, STANDING * 2))
    assert np.array_equal(poses.relative, before)
    assert poses.stamp_ns == message(14).stamp_ns


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (nobody(15), "keypoints are not valid: nobody in view"),
        (lost(15, [0, 1]), "upper-body centre"),
        (lost(15, [6, 7]), "upper-body centre"),
        (lost(15, [2, 3, 4, 5, 8, 9, 10]), "5 of 12 keypoints are there, limit 6"),
        (message(15, body_length_px=np.nan), "body length is nan px, limit 16"),
        (message(15, body_length_px=15.0), "body length is 15.0 px, limit 16"),
    ],
)
def test_what_cannot_be_used_is_named_and_forgotten_when_it_is_short(bad, says):
    poses = filled(range(15))
    poses.push(bad)
    assert says in poses.refusal
    poses.push(message(16, moving(16)))
    assert poses.refusal == ""
    assert poses.full
    np.testing.assert_allclose(poses.relative[-2:], [moving(15), moving(16)], atol=1e-6)


def test_a_person_who_is_away_for_long_is_a_new_start():
    poses = filled(range(15))
    for tick in range(15, 19):
        poses.push(nobody(tick))
    assert poses.frames == 0
    poses.push(message(19, moving(19)))
    assert poses.frames == 1


def test_a_lost_point_is_held_relative_to_the_body_then_at_its_average_place():
    poses = window(hold_s=0.5)
    for tick in range(40):
        pose = moving(tick) + tick * 0.2  # the whole body moves through the image
        poses.push(message(tick, pose) if tick < 15 else lost(tick, [4], pose))
        if tick in (20, 29):
            np.testing.assert_allclose(poses.relative[-1, 4], moving(14)[4], atol=1e-5)
        assert (poses.status[-1] == KeypointStatus.LOST).sum() == (tick >= 15)
    np.testing.assert_allclose(poses.relative[-1, 4], MEAN[4], atol=1e-6)


def test_a_point_never_seen_is_at_its_average_place():
    poses = window()
    poses.push(lost(0, [10], moving(0)))
    np.testing.assert_allclose(poses.relative[-1, 10], MEAN[10], atol=1e-6)


def test_nothing_in_the_window_is_ever_nan():
    random = np.random.default_rng(0)
    poses = window()
    for tick in range(200):
        gone = random.choice(12, size=random.integers(0, 13), replace=False).tolist()
        poses.push(lost(tick, gone) if random.random() < 0.8 else nobody(tick))
        assert np.isfinite(poses.relative).all()
        assert np.isfinite(poses.centre_px).all()


def test_reset_forgets():
    poses = filled(range(15))
    poses.reset()
    assert poses.frames == 0
    poses.push(lost(0, [4]))
    np.testing.assert_allclose(poses.relative[-1, 4], MEAN[4], atol=1e-6)
