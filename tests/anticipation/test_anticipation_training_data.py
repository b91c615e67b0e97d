"""Readers, cameras, splits and samples: what the networks are given is what was filmed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anticipation.motion import HORIZON, WINDOW
from anticipation.training.cameras import Camera, draw_camera
from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Clip, data_folder
from anticipation.training.detector import observe
from anticipation.training.samples import clean, cut, nearest
from anticipation.training.splits import grouped_folds, random_windows
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError

STANDING = np.array(
    [
        [-18, -50], [18, -50], [-24, -20], [24, -20], [-26, 8], [26, 8],
        [-12, 0], [12, 0], [-13, 45], [13, 45], [-14, 88], [14, 88],
    ],
    dtype=np.float64,
)  # fmt: skip


def standing(frames, fps, labels=None):
    """Someone who sways a little, 320x240."""
    time = np.arange(frames) / fps
    points = STANDING + np.array([160.0, 110.0]) + 3.0 * np.sin(time)[:, None, None]
    keypoints = np.concatenate([points, np.full((frames, 12, 1), 0.9)], axis=-1)
    return Clip("clip", "group", keypoints, fps, labels, 320, 240, "made", "none")


@settings(deadline=None, max_examples=40)
@given(
    groups=st.lists(st.sampled_from("abcdefghij"), min_size=12, max_size=40),
    folds=st.integers(2, 5),
    seed=st.integers(0, 99),
)
def test_no_group_is_on_both_sides_and_every_clip_is_tested_once(groups, folds, seed):
    if len(set(groups)) < folds:
        with pytest.raises(ValueError, match="cannot be divided"):
            grouped_folds(groups, folds, seed)
        return
    tested = []
    for training, test in grouped_folds(groups, folds, seed):
        assert not {groups[i] for i in training} & {groups[i] for i in test}
        assert len(training) + len(test) == len(groups)
        tested.extend(test.tolist())
    assert sorted(tested) == list(range(len(groups)))


def test_folds_repeat_for_a_seed_and_differ_between_seeds():
    groups = [str(i) for i in range(30)]
    first, again, other = (grouped_folds(groups, 5, seed)[0][1].tolist() for seed in (1, 1, 2))
    assert first == again != other


def test_random_windows_divide_all_windows():
    training, test = random_windows(100, 0)
    assert len(training) == 80
    assert sorted([*training, *test]) == list(range(100))


def camera(**changes):
    values = {
        "height": 1.0, "distance": 4.0, "yaw": 0.0, "roll": 0.0, "field_of_view": np.pi / 2, "aim_height": 1.0,
        "following": True,
    }  # fmt: skip
    return Camera(**{**values, **changes})


def person(x=0.0, y=0.0):
    """A point cloud of 12 at one place, its middle 1 m high."""
    points = np.tile([x, y, 1.0], (1, 12, 1))
    points[0, :6, 2] += 0.5
    points[0, 6:, 2] -= 0.5
    return points


def test_projection_of_a_level_camera_follows_similar_triangles():
    points = person()
    seen = camera().project(points)[0]
    assert np.allclose(seen[:, 0], 160)
    assert np.allclose(seen[0, 1], 120 - 160 * 0.5 / 4.0)  # up in the world is up in the image
    assert np.allclose(seen[6, 1], 120 + 160 * 0.5 / 4.0)
    assert np.allclose((camera(distance=8.0).project(points)[0] - [160, 120]) * 2, seen - [160, 120])


def test_a_camera_looking_along_x_sees_the_left_hand_side_on_the_left():
    points = person()
    points[0, 0, 1] += 0.3  # y is left of x
    assert camera().project(points)[0, 0, 0] < 160
    assert camera(yaw=np.pi).project(points)[0, 0, 0] > 160


def test_a_following_camera_does_not_see_where_the_person_is_and_a_fixed_one_does():
    path = np.concatenate([person(x) for x in (0.0, 1.0, 2.0)])
    following = camera().project(path)
    fixed = camera(following=False).project(path)
    assert np.allclose(following[0], following[2])
    assert abs(fixed[0, 0, 1] - fixed[2, 0, 1]) > 1


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_a_drawn_camera_has_a_rotation_and_sees_the_person(seed):
    drawn = draw_camera(np.random.default_rng(seed))
    rotation = drawn.rotation()
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.isclose(np.linalg.det(rotation), 1)
    assert np.isfinite(drawn.project(person())).all()


def test_the_detector_moves_points_by_little_and_some_by_much():
    points = np.tile(STANDING + 100, (400, 1, 1))
    seen = observe(points, np.random.default_rng(0))
    error = np.linalg.norm(seen[..., :2] - points, axis=-1) / 50  # the trunk is 50 px long
    assert 0.02 < np.nanmedian(error) < 0.12  # in some frames nobody is found
    assert 0.002 < (error > 0.5).mean() < 0.1
    assert (seen[..., 2] >= 0).all()
    assert (seen[..., 2] <= 1).all()


def test_what_the_camera_cannot_see_the_detector_does_not_report():
    points = np.tile(STANDING + 100, (20, 1, 1))
    points[3, 4] = np.nan
    seen = observe(points, np.random.default_rng(0))
    assert np.isnan(seen[3, 4, :2]).all()
    assert seen[3, 4, 2] == 0


@pytest.mark.parametrize("fps", [11.6, 14.4, 30.0])
def test_labels_stay_with_their_time_after_resampling(fps):
    frames = round(6 * fps)
    changes_s = 2.0, 4.0
    labels = np.searchsorted(changes_s, np.arange(frames) / fps, side="right")
    track = clean(standing(frames, fps, labels), CleaningConfig())
    time = np.arange(len(track.labels)) / 30.0
    for change_s, (before, after) in zip(changes_s, ((STABLE, TRANSIENT), (TRANSIENT, FALL)), strict=True):
        assert (track.labels[(time < change_s - 1 / fps) & (time > change_s - 1)] == before).all()
        assert (track.labels[(time > change_s + 1 / fps) & (time < change_s + 1)] == after).all()


def test_nearest_picks_the_closest_stamp():
    stamps = np.array([0, 10, 20])
    assert nearest(stamps, np.array([-5, 4, 6, 15, 99])).tolist() == [0, 0, 1, 1, 2]
    assert nearest(np.array([7]), np.array([0, 50])).tolist() == [0, 0]


def test_samples_hold_what_was_seen_what_came_and_its_labels():
    labels = np.arange(80) % 3
    track = clean(standing(80, 30.0, labels), CleaningConfig())
    samples = cut([track])
    frames = len(track.poses)
    assert samples.frames.shape[1:] == (WINDOW + HORIZON, 13, 2)
    first = np.flatnonzero(track.whole)[0]
    assert np.allclose(samples.poses[0], track.poses[first : first + WINDOW + HORIZON], atol=1e-6)
    assert (samples.labels[0] == track.labels[first + WINDOW - 1 : first + WINDOW + HORIZON]).all()
    last = samples.known[-1]
    assert last[:WINDOW].all()
    assert not last[WINDOW:].any()
    assert (samples.labels[-1, 1:] == UNLABELLED).all()
    assert np.allclose(samples.poses[-1, WINDOW:], samples.poses[-1, WINDOW - 1])
    assert len(samples) == frames - first - WINDOW + 1


def test_windows_with_a_lost_keypoint_are_left_out():
    clip = standing(120, 30.0, np.zeros(120, dtype=np.int64))
    keypoints = clip.keypoints.copy()
    keypoints[50:70, 4] = np.nan
    holed = Clip("holed", "group", keypoints, 30.0, clip.labels, 320, 240, "made", "none")
    track = clean(holed, CleaningConfig())
    assert not track.whole.all()
    assert len(cut([track])) < len(cut([clean(clip, CleaningConfig())]))


def test_missing_data_is_named(tmp_path, monkeypatch):
    monkeypatch.delenv("SUREFOOT_DATA", raising=False)
    with pytest.raises(SourceError, match="SUREFOOT_DATA"):
        data_folder(None)
    with pytest.raises(SourceError, match="nowhere"):
        data_folder(tmp_path / "nowhere")


def test_damaged_data_is_named(tmp_path):
    from anticipation.training.clips import load_arrays

    whole = tmp_path / "whole.npz"
    np.savez(whole, poses=np.zeros((50, 12, 3)))
    with pytest.raises(SourceError, match="has no array 'label'"):
        load_arrays(whole)["label"]
    cut_off = tmp_path / "cut.npz"
    cut_off.write_bytes(whole.read_bytes()[:200])
    with pytest.raises(SourceError, match=r"cut\.npz"):
        load_arrays(cut_off)


def test_labels_must_fit_the_frames():
    with pytest.raises(SourceError, match="labels"):
        standing(10, 30.0, np.zeros(9, dtype=np.int64))


def test_upfall_frames_that_contradict_the_other_labels_carry_none(tmp_path):
    from anticipation.training import upfall

    fps, frames = 10.0, 60
    tilt = np.zeros(frames)
    tilt[30:50] = np.pi / 2  # lies from 30 to 50, stands afterwards
    turn = np.stack([np.cos(tilt), -np.sin(tilt), np.sin(tilt), np.cos(tilt)], axis=1).reshape(-1, 2, 2)
    points = np.einsum("nij,kj->nki", turn, STANDING) + 300
    keypoints = np.concatenate([points, np.full((frames, 12, 1), 0.9)], axis=-1)
    given = np.r_[np.full(5, -1), np.zeros(25), np.ones(30)]
    folder = tmp_path / "upfall"
    folder.mkdir()
    arrays = {}
    for activity, labels in ((1, given), (11, np.full(frames, -1))):
        name = f"activity{activity:02d}-trial1-cam1"
        arrays |= {f"{name}/movenet": keypoints, f"{name}/label": labels, f"{name}/fps": np.array(fps)}
    np.savez(folder / "subject1_cam1.npz", **arrays)
    fall, on_purpose = upfall.read(tmp_path)
    assert (fall.labels[:5] == STABLE).all()
    assert (fall.labels[5:20] == UNLABELLED).all()  # more than a second before lying
    assert (fall.labels[20:30] == TRANSIENT).all()
    assert (fall.labels[30:50] == FALL).all()
    assert (fall.labels[50:] == UNLABELLED).all()
    assert (on_purpose.labels[30:50] == UNLABELLED).all()
    assert (on_purpose.labels[:30] == STABLE).all()


@pytest.mark.data
def test_the_research_data_reads_as_described(data_dir):
    from anticipation.training import upfall, urfd

    falls = urfd.read_falls(data_dir, "alphapose")
    assert len(falls) == 24
    assert all((clip.labels == TRANSIENT).sum() == 30 for clip in falls)
    assert {clip.group for clip in falls} == {clip.group for clip in urfd.read_falls(data_dir, "movenet")}
    assert not (urfd.read_daily(data_dir)[0].labels > STABLE).any()
    clips = upfall.read(data_dir)
    assert len(clips) == 33
    assert sum(upfall.is_fall(clip) for clip in clips) == 15
    for clip in clips:
        if not upfall.is_fall(clip):
            assert not (clip.labels > STABLE).any()
