"""The kinematic person: a body with bones, a walk with steps, falls that end on the floor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.skeleton import LINKS, MIRROR
from simulation.kinematic import body, gait
from simulation.kinematic.body import FLESH, Posture, mirrored, points, standing
from simulation.kinematic.events import STEP_S, Sit, Stumble, smooth
from simulation.kinematic.fall import Fall
from simulation.kinematic.motion import Walker, move

LIMBS = LINKS[:8]  # arms and legs
LIMB_LENGTHS = [body.UPPER_ARM, body.FOREARM] * 2 + [body.THIGH, body.SHANK] * 2
DIRECTIONS = [0.0, 70.0, 90.0, 135.0, 180.0, -90.0, -30.0]


def motion(*events, duration_s=4.0, seed=0, **walker):
    return move(Walker(**walker), events, duration_s, np.random.default_rng(seed))


def lengths(keypoints, links):
    return np.linalg.norm(keypoints[:, links[:, 1]] - keypoints[:, links[:, 0]], axis=-1)


def random_posture(seed: int) -> Posture:
    rng = np.random.default_rng(seed)
    return Posture(*(rng.uniform(-1.5, 1.5, size=part.shape) for part in standing(3)))


def test_standing_has_the_proportions_of_the_source():
    height = 1.8
    upright = points(standing(1), height, np.eye(3)[None])
    z = upright.keypoints[0, :, 2] - upright.feet[0, :, 2].min()
    assert z[6:8] == pytest.approx(0.530 * height)
    assert z[8:10] == pytest.approx(0.285 * height)
    assert z[10:12] == pytest.approx(0.039 * height)
    assert z[0:2] == pytest.approx(0.818 * height)
    assert np.linalg.norm(upright.feet[0, 2] - upright.feet[0, 0]) == pytest.approx(0.152 * height)


@pytest.mark.parametrize("direction_deg", DIRECTIONS)
def test_bones_keep_their_length(direction_deg):
    moved = motion(Stumble(0.5), Fall(1.8, np.radians(direction_deg)), height_m=1.65)
    assert lengths(moved.keypoints_m, LIMBS) == pytest.approx(
        np.broadcast_to(1.65 * np.array(LIMB_LENGTHS), (len(moved.time_s), 8)), abs=1e-9
    )
    shoulders = moved.keypoints_m[:, 0:2].mean(axis=1)
    hips = moved.keypoints_m[:, 6:8].mean(axis=1)
    assert np.ptp(np.linalg.norm(shoulders - hips, axis=1)) < 1e-9
    assert np.ptp(lengths(moved.keypoints_m, LINKS[8:10]), axis=0) == pytest.approx(0.0, abs=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_a_mirrored_posture_is_the_mirror_image(seed):
    posture = random_posture(seed)
    one = points(posture, 1.7, body.rotation(np.zeros((3, 3)))).keypoints
    other = points(mirrored(posture), 1.7, body.rotation(np.zeros((3, 3)))).keypoints
    assert other == pytest.approx(one[:, MIRROR] * [1.0, -1.0, 1.0], abs=1e-12)


def test_angles_turn_the_limbs_the_way_they_say():
    posture = standing(1)
    posture.hip[0, 0, 0] = posture.knee[0, 1] = posture.shoulder[0, 0, 0] = np.pi / 2
    posture.shoulder[0, 1, 1] = np.pi / 2
    p = points(posture, 1.0, np.eye(3)[None]).keypoints[0]
    assert p[8] - p[6] == pytest.approx([body.THIGH, 0.0, 0.0], abs=1e-12)  # left thigh forward
    assert p[11] - p[9] == pytest.approx([-body.SHANK, 0.0, 0.0], abs=1e-12)  # right shank backward
    assert p[2] - p[0] == pytest.approx([body.UPPER_ARM, 0.0, 0.0], abs=1e-12)  # left arm forward
    assert p[3] - p[1] == pytest.approx([0.0, -body.UPPER_ARM, 0.0], abs=1e-12)  # right arm out to the right


def test_the_gait_curves_pass_through_their_norm_values():
    phase = np.arange(10) / 10
    for curve in (gait.HIP_DEG, gait.KNEE_DEG, gait.ANKLE_DEG):
        harmonics = gait.series(curve)
        assert gait.evaluate(harmonics, phase) == pytest.approx(curve)
        assert gait.evaluate(harmonics, phase + 3.0) == pytest.approx(curve)


def test_left_and_right_walk_alike_half_a_stride_apart():
    phase = np.linspace(0.0, 1.0, 50)
    now, later = gait.walking(phase, 1.0), gait.walking(phase + 0.5, 1.0)
    for one, other in zip(now, mirrored(later), strict=True):
        assert one == pytest.approx(other, abs=1e-12)


@pytest.mark.parametrize("speed", [0.5, 0.9, 1.3])
@pytest.mark.parametrize("height", [1.55, 1.9])
def test_step_length_and_cadence_make_the_speed(speed, height):
    assert gait.step_length(speed, height) * gait.cadence(speed, height) == pytest.approx(speed)
    amplitude = gait.stride_amplitude(speed, height)
    heel_strike = points(gait.walking(np.zeros(1), amplitude), height, np.eye(3)[None]).keypoints[0]
    assert heel_strike[10, 0] - heel_strike[11, 0] == pytest.approx(gait.step_length(speed, height), abs=1e-6)
    moved = motion(duration_s=6.0, speed_m_s=speed, height_m=height)
    assert (moved.hips_m[-1, 0] - moved.hips_m[0, 0]) / 6.0 == pytest.approx(speed, rel=0.05)


@pytest.mark.parametrize("direction_deg", DIRECTIONS)
def test_nothing_goes_through_the_floor_and_something_rests_on_it(direction_deg):
    moved = motion(Stumble(0.3), Fall(1.5, np.radians(direction_deg)))
    everything = np.concatenate([moved.keypoints_m, moved.feet_m], axis=1)[..., 2]
    lowest = (everything - FLESH * 1.72).min(axis=1)
    assert lowest.min() > -1e-9
    assert lowest.max() < 0.03  # the soft minimum lifts a body that lies on many points


def test_a_standing_foot_hardly_slides():
    moved = motion(duration_s=4.0, variability=0.0)
    speed = np.diff(moved.feet_m[:, :, 0], axis=0) / STEP_S
    slowest = np.abs(speed).min(axis=1)  # of heels and toes, at each time
    assert np.median(slowest) < 0.25 * 0.9


def test_motion_is_smooth():
    moved = motion(Stumble(0.8), Fall(2.2, np.radians(75.0)))
    speed = np.linalg.norm(np.diff(moved.keypoints_m, axis=0), axis=-1) / STEP_S
    assert speed.max() < 8.0  # a wrist thrown out; nothing jumps


def test_a_stumble_is_survived_and_lowers_the_body():
    calm, stumbled = motion(duration_s=5.0), motion(Stumble(1.5), duration_s=5.0)
    assert (stumbled.label == -1).all()
    during = (calm.time_s > 1.5) & (calm.time_s < 2.7)
    lean = [np.ptp(m.keypoints_m[during, 0:2, 0].mean(axis=1) - m.hips_m[during, 0]) for m in (calm, stumbled)]
    assert lean[1] > lean[0] + 0.1
    after = calm.time_s > 3.0
    assert stumbled.hips_m[after, 2].mean() == pytest.approx(calm.hips_m[after, 2].mean(), abs=0.02)


@pytest.mark.parametrize("direction_deg", DIRECTIONS)
def test_a_fall_ends_lying_where_it_was_going(direction_deg):
    fall = Fall(1.0, np.radians(direction_deg))
    moved = motion(fall, duration_s=4.0)
    assert 0.6 <= fall.ground_s <= 1.3
    assert moved.hips_m[-1, 2] < 0.30
    assert moved.keypoints_m[-1, 0:2, 2].mean() < 0.35
    shoulders = moved.keypoints_m[-1, 0:2, :2].mean(axis=0) - moved.keypoints_m[-1, 10:12, :2].mean(axis=0)
    towards = np.array([np.cos(fall.direction_rad), np.sin(fall.direction_rad)])
    assert shoulders @ towards / np.linalg.norm(shoulders) > 0.8
    descent = -np.diff(moved.hips_m[:, 2]) / STEP_S
    assert 0.9 < descent.max() < 3.4  # Choi et al. 2015: 2.14 (0.63) m/s


def test_labels_follow_the_fall():
    fall = Fall(1.0, 0.0)
    moved = motion(fall, duration_s=3.0)
    assert (moved.label[moved.time_s < 1.0] == -1).all()
    assert (np.diff(moved.label) >= 0).all()
    assert moved.time_s[moved.label == 1][0] == pytest.approx(1.0 + fall.ground_s, abs=2 * STEP_S)


def test_a_fall_to_the_right_mirrors_one_to_the_left():
    left, right = Fall(0.0, np.radians(80.0)), Fall(0.0, np.radians(-80.0))
    time_s = np.linspace(0.0, 2.0, 30)
    one = points(left.posture(time_s, standing(30)), 1.7, left.attitude(time_s)).keypoints
    other = points(right.posture(time_s, standing(30)), 1.7, right.attitude(time_s)).keypoints
    assert other == pytest.approx(one[:, MIRROR] * [1.0, -1.0, 1.0], abs=1e-9)


def test_sitting_lowers_the_hips_to_the_knees_and_standing_up_undoes_it():
    moved = motion(Sit(1.0, stay_s=1.0), duration_s=7.0)
    seated = np.searchsorted(moved.time_s, 3.2)
    knees = moved.keypoints_m[seated, 8:10, 2].mean()
    assert moved.hips_m[seated, 2] == pytest.approx(knees, abs=0.08)
    assert moved.hips_m[-1, 2] == pytest.approx(0.530 * 1.72, abs=0.05)
    assert (moved.label == -1).all()


def test_smooth_rises_from_nought_to_one_without_a_kink():
    u = np.linspace(-0.5, 1.5, 2001)
    value = smooth(u)
    assert value[0] == 0.0
    assert value[-1] == 1.0
    assert (np.diff(value) >= 0).all()
    assert np.abs(np.diff(value, n=2)).max() < 1e-5
