"""LaFAN1's ground contacts: who fell was seen by eye, and the labels follow the motion."""

import json

import numpy as np
import pytest

from anticipation.training import lafan1
from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, load_arrays
from anticipation.training.lafan1 import Contact, label, measure, on_ground
from anticipation.training.lafan1_review import VERDICTS, Seen
from bridge.errors import SourceError


def body(height_m, tilt):
    """Twelve points of people whose hips are at a height and whose trunk leans, (T, 12, 3) [m]."""
    points = np.zeros((len(height_m), 12, 3))
    points[:, :, 2] = np.asarray(height_m)[:, None]
    points[:, 0:2, 0] = 0.5 * np.sin(tilt)[:, None]
    points[:, 0:2, 2] += 0.5 * np.cos(tilt)[:, None]
    return points


def going_down(frames):
    """Stand for a second, come down in so many frames, lie for two seconds."""
    share = np.clip((np.arange(90 + frames) - 30) / frames, 0, 1)
    return body(0.95 - 0.8 * share, share * np.pi / 2), Contact("file", 30, 30 + frames, 90 + frames)


def test_a_quick_descent_is_like_a_fall_and_a_slow_one_is_not():
    assert measure(*going_down(15)).like_a_fall  # 1.6 m/s
    assert not measure(*going_down(45)).like_a_fall  # 0.5 m/s
    points, contact = going_down(15)
    assert np.isclose(measure(points, contact).speed, 0.8 / 0.5, rtol=0.05)


def test_labels_of_a_fall_follow_the_motion():
    points, _ = going_down(45)
    labels = label(points, 30, fell=True)
    down = int(np.argmax(on_ground(points)))
    assert (labels[:30] == STABLE).all()
    assert (labels[30 : down - 30] == UNLABELLED).all()  # more than a second before lying
    assert (labels[down - 30 : down] == TRANSIENT).all()
    assert (labels[down:] == FALL).all()


def test_who_rises_again_is_no_longer_fallen():
    points, _ = going_down(15)
    points = np.concatenate([points, points[:20]])
    labels = label(points, 30, fell=True)
    assert (labels[-20:] == UNLABELLED).all()


def test_lying_down_without_a_fall_is_stable_until_the_floor():
    points, _ = going_down(45)
    labels = label(points, 30, fell=False)
    assert set(labels[on_ground(points)]) == {UNLABELLED}
    assert set(labels[~on_ground(points)]) == {STABLE}


def test_each_contact_was_judged_once_and_says_what_it_is():
    assert len({(verdict.file, verdict.ground) for verdict in VERDICTS}) == len(VERDICTS)
    assert all(verdict.what for verdict in VERDICTS)
    assert sum(verdict.file.startswith("fallAndGetUp") for verdict in VERDICTS) == 90


@pytest.mark.parametrize("content", ["", "[]", '{"a": [{"onset": 1}]}', '{"a": [{"onset": 1, "ground": "x"}]}'])
def test_a_damaged_list_of_contacts_is_named(tmp_path, content):
    (tmp_path / "mocap").mkdir()
    (tmp_path / "mocap" / "lafan1_ground_events.json").write_text(content)
    with pytest.raises(SourceError, match=r"lafan1_ground_events\.json"):
        lafan1.read_contacts(tmp_path)


def test_a_contact_that_was_not_reviewed_is_left_out(tmp_path):
    (tmp_path / "mocap").mkdir()
    events = {VERDICTS[0].file: [{"onset": 1, "ground": g, "recover": 9} for g in (VERDICTS[0].ground, -5)]}
    (tmp_path / "mocap" / "lafan1_ground_events.json").write_text(json.dumps(events))
    [(contact, verdict)] = lafan1.read_contacts(tmp_path)
    assert (contact.ground, verdict) == (VERDICTS[0].ground, VERDICTS[0])


@pytest.mark.data
def test_what_was_called_a_fall_meets_the_criteria_and_what_was_not_is_slow_or_says_why(data_dir):
    motions = load_arrays(data_dir / "mocap" / "lafan1.npz")
    contacts = lafan1.read_contacts(data_dir)
    assert len(contacts) == len(VERDICTS)
    for contact, verdict in contacts:
        descent = measure(motions[contact.file], contact)
        if verdict.seen is Seen.FALL:
            assert descent.like_a_fall, verdict
        elif verdict.seen is Seen.UNCLEAR:
            assert not descent.like_a_fall, verdict
    falls = lafan1.read_falls(data_dir, cameras=1, seed=0)
    for clip in falls:
        assert (clip.labels[:40] == STABLE).all()
        assert {STABLE, TRANSIENT, FALL} <= set(clip.labels)
    others = lafan1.read_others(data_dir, cameras=1, seed=0)
    assert len(falls) == 18
    assert len(others) == 63
    assert not {clip.group for clip in falls} & {clip.group for clip in others}
    assert all(set(clip.labels) <= {STABLE, UNLABELLED} for clip in others)
