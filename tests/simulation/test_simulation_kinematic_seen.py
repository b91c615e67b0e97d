"""What camera and detector make of the kinematic person, and the recording that ships."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import simulation
from simulation.kinematic.camera import Camera
from simulation.kinematic.detector import Detector
from simulation.kinematic.fall import Fall
from simulation.kinematic.motion import Walker
from simulation.kinematic.recording import DEMO, DEMO_CAMERA, demo, record, save

PERFECT = Detector(
    wander=0.0, jitter=0.0, lying=1.0, far_side=1.0, misplaced_hz=0.0, dropped=0.0, missed=0.0
)  # fmt: skip
STILL = Camera(follow_s=None)


def project(camera, *world):
    return camera.project(np.array([world], dtype=float), np.zeros((1, 2)))[0]


def person(frames=1200, distance=3.0):
    """A motionless upright person in the image: (T, 12, 3) x, y [px], depth [m]."""
    x = np.array([140, 180, 135, 185, 132, 188, 148, 172, 148, 172, 148, 172], dtype=float)
    y = np.array([80, 80, 105, 105, 125, 125, 130, 130, 165, 165, 200, 200], dtype=float)
    depth = np.full(12, distance) + 0.01 * (np.arange(12) % 2)
    return np.broadcast_to(np.stack([x, y, depth], axis=1), (frames, 12, 3)).copy()


def test_what_is_looked_at_is_in_the_middle():
    camera = Camera(position_m=(1.0, -2.5, 1.4), look_at_m=(0.2, 0.1, 0.8), follow_s=None)
    seen = project(camera, camera.look_at_m)[0]
    assert seen[:2] == pytest.approx([160.0, 120.0])
    assert seen[2] == pytest.approx(np.linalg.norm(np.subtract(camera.look_at_m, camera.position_m)))


def test_right_up_and_near_are_where_they_belong():
    camera = Camera(position_m=(0.0, -3.0, 1.0), look_at_m=(0.0, 0.0, 1.0), follow_s=None)  # looks to the left, along y
    right, up, near = project(camera, (0.5, 0.0, 1.0), (0.0, 0.0, 1.5), (0.5, -1.5, 1.0))
    assert right[0] > 160.0
    assert up[1] < 120.0
    assert near[0] - 160.0 == pytest.approx(2.0 * (right[0] - 160.0))  # half as far away, twice as large
    assert right[0] - 160.0 == pytest.approx(camera.focal_px * 0.5 / 3.0)


def test_the_field_of_view_reaches_the_edges():
    camera = Camera(position_m=(0.0, -2.0, 1.0), look_at_m=(0.0, 0.0, 1.0), field_of_view_rad=np.pi / 2, follow_s=None)
    assert project(camera, (2.0, 0.0, 1.0))[0, 0] == pytest.approx(320.0)


def test_behind_the_camera_there_is_nothing():
    assert np.isnan(project(STILL, (0.0, -5.0, 1.0))).all()


@settings(deadline=None, max_examples=30)
@given(st.floats(-3.0, 3.0), st.floats(-2.0, -1.0), st.floats(0.5, 2.0), st.floats(-0.3, 0.3))
def test_the_cameras_axes_are_a_rotation(x, y, z, roll):
    axes = Camera(position_m=(x, y, z), roll_rad=roll).axes()
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_following_camera_stays_with_a_steady_walker_and_comes_to_rest_with_them():
    camera = Camera(follow_s=0.5)
    time_s = np.arange(0.0, 6.0, 0.005)
    path = np.stack([np.minimum(time_s, 3.0), np.zeros(len(time_s))], axis=1)
    anchored = camera.anchor(path, 0.005)
    walking = time_s < 3.0
    assert anchored[walking] == pytest.approx(path[walking], abs=0.01)
    lag = camera.anchor(path, 0.005)[-1] - path[-1]
    assert np.abs(np.diff(anchored[-50:], axis=0)).max() < 1e-5
    assert np.linalg.norm(lag) < 0.6  # it ran on by what it lagged before


def test_a_still_camera_stays():
    assert (STILL.anchor(np.ones((5, 2)), 0.1) == 0.0).all()


def test_a_perfect_detector_reports_what_is_there():
    exact = person(50)
    seen = PERFECT.observe(exact, 30.0, np.random.default_rng(0))
    assert seen[..., :2] == pytest.approx(exact[..., :2])
    assert ((seen[..., 2] > 0.1) & (seen[..., 2] <= 1.0)).all()


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0])
def test_noise_has_the_size_it_says_at_every_frame_rate(fps):
    detector = Detector(misplaced_hz=0.0, dropped=0.0, missed=0.0, far_side=1.0, lying=1.0)
    exact = person(round(120 * fps))
    error = (detector.observe(exact, fps, np.random.default_rng(1)) - exact)[..., :2] / 50.0  # trunk of 50 px
    assert error.std() == pytest.approx(np.hypot(detector.wander, detector.jitter), rel=0.1)
    step = np.diff(error, axis=0).std() / np.sqrt(2.0)
    slow = detector.wander * np.sqrt(1.0 - np.exp(-1.0 / (fps * detector.memory_s)))
    assert step == pytest.approx(np.hypot(detector.jitter, slow), rel=0.1)


def test_noise_does_not_depend_on_the_resolution():
    small, large = person(200), person(200)
    large[..., :2] *= 3.0
    one, other = (Detector().observe(p, 30.0, np.random.default_rng(2)) for p in (small, large))
    assert other[..., :2] == pytest.approx(3.0 * one[..., :2], nan_ok=True)


def test_dropouts_lapses_and_misses_come_as_often_as_they_say():
    detector = Detector(dropped=0.05, missed=0.02, misplaced_hz=0.3, wander=0.0, jitter=0.0)
    exact = person(6000)
    seen = detector.observe(exact, 30.0, np.random.default_rng(3))
    lost = np.isnan(seen[..., 0])
    assert (seen[lost][:, 2] == 0.0).all()
    assert lost.mean() == pytest.approx(0.05 + 0.02, rel=0.15)
    assert lost.all(axis=1).mean() == pytest.approx(0.02, rel=0.3)
    away = np.abs(seen[..., 0] - exact[..., 0])[~lost] > 1.0
    assert away.mean() == pytest.approx(0.3 * detector.misplaced_s, rel=0.25)


def test_lying_and_far_points_are_worse():
    detector = Detector(misplaced_hz=0.0, dropped=0.0, missed=0.0)
    upright = person(3000)
    lying = upright.copy()
    lying[..., :2] = lying[..., 1::-1]
    errors = [detector.observe(p, 30.0, np.random.default_rng(4)) - p for p in (upright, lying)]
    assert errors[1][..., :2].std() > 1.8 * errors[0][..., :2].std()
    assert errors[0][:, 1::2, :2].std() > 1.2 * errors[0][:, 0::2, :2].std()


def test_what_is_behind_the_camera_is_not_found():
    exact = person(5)
    exact[2, 4] = np.nan
    seen = PERFECT.observe(exact, 30.0, np.random.default_rng(0))
    assert np.isnan(seen[2, 4, :2]).all()
    assert seen[2, 4, 2] == 0.0


def test_the_same_seed_gives_the_same_recording_and_another_one_does_not():
    one, same, other = (
        record(Walker(), (Fall(0.8, 1.2),), 2.0, DEMO_CAMERA, Detector(), 30.0, seed) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.keypoints, same.keypoints)
    assert not np.array_equal(one.exact, other.exact)


@pytest.mark.parametrize("fps", [15.0, 24.0, 60.0])
def test_the_motion_does_not_depend_on_the_frame_rate(fps):
    at_30, other = (record(Walker(), (Fall(0.8, 1.2),), 2.0, DEMO_CAMERA, Detector(), f, 3) for f in (30.0, fps))
    assert len(other.keypoints) == round(2.0 * fps)
    times = np.arange(len(at_30.exact)) / 30.0
    there = np.isin(np.round(times, 6), np.round(np.arange(len(other.exact)) / fps, 6))
    same = np.round(times[there] * fps).astype(int)
    assert other.exact[same] == pytest.approx(at_30.exact[there], abs=0.5)
    np.testing.assert_array_equal(other.label[same], at_30.label[there])


def test_a_mirrored_world_seen_by_a_mirrored_camera_is_the_mirrored_image():
    world = np.random.default_rng(0).uniform(-1.0, 1.0, size=(1, 20, 3))
    across = np.array([1.0, -1.0, 1.0])
    one = Camera(position_m=(1.0, -3.0, 1.3), look_at_m=(0.1, 0.2, 0.8), roll_rad=0.1)
    other = Camera(position_m=(1.0, 3.0, 1.3), look_at_m=(0.1, -0.2, 0.8), roll_rad=-0.1)
    seen, mirrored = one.project(world, np.zeros((1, 2))), other.project(world * across, np.zeros((1, 2)))
    assert mirrored * [-1.0, 1.0, 1.0] + [320.0, 0.0, 0.0] == pytest.approx(seen)


def test_the_demo_tells_its_story():
    story = demo()
    seconds = len(story.keypoints) / story.fps
    assert 12.0 <= seconds <= 16.0
    assert story.image_size == (320, 240)
    falling, lying = np.flatnonzero(story.label == 0), np.flatnonzero(story.label == 1)
    assert falling[0] / story.fps > 8.0
    assert 0.6 <= len(falling) / story.fps <= 1.3
    assert len(lying) / story.fps >= 2.0
    inside = (story.exact[..., 0] > 0) & (story.exact[..., 0] < 320) & (story.exact[..., 1] > 0)
    assert (inside & (story.exact[..., 1] < 240)).all()
    tall = np.ptp(story.exact[story.label == -1, :, 1], axis=1)
    assert 85 < np.median(tall) < 170  # as in the public recordings of falls


def test_the_shipped_file_is_what_the_command_writes(tmp_path):
    shipped = Path(simulation.__file__).parent / "demo" / f"{DEMO}.npz"
    save({DEMO: demo(0)}, tmp_path / "again.npz")
    with np.load(shipped) as old, np.load(tmp_path / "again.npz") as new:
        assert (
            sorted(old.files)
            == sorted(new.files)
            == [f"{DEMO}/{k}" for k in ("fps", "image_size", "keypoints", "label")]
        )
        np.testing.assert_allclose(old[f"{DEMO}/keypoints"], new[f"{DEMO}/keypoints"], atol=0.02)
        for key in ("fps", "image_size", "label"):
            np.testing.assert_array_equal(old[f"{DEMO}/{key}"], new[f"{DEMO}/{key}"])
    assert shipped.stat().st_size < 100_000


def test_saving_leaves_no_half_written_file(tmp_path):
    save({DEMO: demo(1)}, tmp_path / "deep" / "a.npz")
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["a.npz"]
    save({DEMO: demo(1)}, tmp_path / "b.npz")
    assert (tmp_path / "b.npz").read_bytes() == (tmp_path / "deep" / "a.npz").read_bytes()
