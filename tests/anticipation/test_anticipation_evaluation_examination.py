"""Clips through the predictor and through the whole system, and what unfamiliar input does to the quality."""

from dataclasses import replace

import numpy as np
import pytest
from anticipation_nets import random_checkpoint
from anticipation_records import clip_of

from anticipation import checkpoint
from anticipation.predictor import Predictor
from anticipation.training.evaluation.examination import SHIFTED, examine
from anticipation.training.evaluation.live import watch
from anticipation.training.evaluation.recordings import Recording, read_partial
from anticipation.training.evaluation.stream import cleaned, hear, whole_windows
from anticipation.training.shifted import ShiftedNetwork
from bridge.config.anticipation import AnticipationConfig
from bridge.config.perception import CleaningConfig
from bridge.config.surefoot import SurefootConfig
from bridge.messages import STEPS
from perception.features import relative
from simulation.kinematic.recording import demo


@pytest.fixture(scope="module")
def shipped():
    return Predictor(checkpoint.load(), AnticipationConfig())


@pytest.fixture(scope="module")
def walker():
    """Two seconds of someone walking as an estimator sees them, one message a tick."""
    made = demo()
    clip = clip_of(0)
    keypoints = made.keypoints[:60]
    walking = type(clip)("walk", "walk", keypoints, 30.0, None, *made.image_size, "made", "none")
    return cleaned(walking, CleaningConfig())


def quality(predictor, ticks):
    """Quality once the window is full of what is pushed; 0 where the horizon is declared invalid."""
    heard = hear(predictor, ticks)
    late = slice(len(ticks) // 2, None)
    return float(np.where(heard.valid[late], heard.quality[late], 0.0).mean())


def test_quality_is_high_for_one_person_seen_whole_and_drops_for_anything_else(shipped, walker):
    usual = quality(shipped, walker)
    assert usual > 0.8
    lost = []
    for number in (2, 4, 6):  # wrists, then elbows, then knees
        there = np.isin(np.arange(12), [4, 5, 2, 3, 8, 9][:number], invert=True)
        partly = [
            replace(
                each,
                position_px=np.where(there[:, None], each.position_px, np.nan),
                status=np.where(there, each.status, 2).astype(np.uint8),
            )
            for each in walker
        ]
        lost.append(quality(shipped, partly))
    assert usual > lost[0] > lost[1] > lost[2]
    assert lost[2] < 0.35
    assert quality(shipped, [replace(each, people=3) for each in walker]) < 0.75 * usual
    assert quality(shipped, [replace(each, valid=False, reason="nobody in view") for each in walker]) == 0
    assert quality(shipped, [replace(each, status=np.ones(12, dtype=np.uint8)) for each in walker]) < 0.6 * usual


def test_skeletons_unlike_a_person_are_several_times_as_strange(walker):
    statistics = checkpoint.load().statistics

    def strangeness(order):
        poses = [relative(tick.position_px[order], tick.body_length_px) for tick in walker[30:]]
        return float(np.median(statistics.strangeness(np.array(poses))))

    usual = strangeness(np.arange(12))
    assert usual < 0.5
    for seed in range(10):
        assert strangeness(np.random.default_rng(seed).permutation(12)) > 2.5 * usual


def test_what_comes_later_changes_nothing_said_before(walker):
    predictor = Predictor(random_checkpoint(), AnticipationConfig())
    full, half = hear(predictor, walker), hear(predictor, walker[:40])
    for one, other in zip(full, half, strict=True):
        assert np.array_equal(one[:40], other, equal_nan=True)


@pytest.mark.parametrize(("outlook", "judges"), [(True, "DGNN + outlook"), (False, "DGNN")])
def test_examination_notes_every_tick_and_every_simpler_way(outlook, judges):
    made = random_checkpoint()
    made = made if outlook else replace(made, outlook=None)
    clips = [Recording(clip_of(number), "fall") for number in range(2)]
    records = examine(made, ShiftedNetwork().eval(), [], clips, 3)
    for record, (clip, kind) in zip(records, clips, strict=True):
        ticks = record.ticks
        assert (record.name, record.part, record.kind) == (clip.name, 3, kind)
        assert len(ticks) == len(clip.keypoints)
        assert (ticks.tested == whole_windows(ticks.whole)).all()
        assert (ticks.valid | ~ticks.tested).mean() > 0.9
        assert np.isfinite(ticks.probabilities[ticks.valid]).all()
        assert np.isnan(ticks.probabilities[~ticks.valid]).all()
        assert set(ticks.rows) == {SHIFTED, f"zero velocity + {judges}", f"constant velocity + {judges}"}
        said = ticks.rows[SHIFTED][ticks.tested]
        assert (said[:, ::3] >= 0).all()
        assert (said[:, 1::3] == -1).all()
        still = ticks.rows[f"zero velocity + {judges}"][ticks.valid]
        assert (still[:, 0] == ticks.probabilities[ticks.valid][:, 0].argmax(axis=-1)).all()


def test_the_whole_system_sees_a_fall_frame_by_frame(tmp_path):
    path = tmp_path / "part.safetensors"
    checkpoint.save(checkpoint.load(), path)
    clip = clip_of(1)
    done = []
    (frames,) = watch([clip], path, SurefootConfig(), lambda: done.append(1))
    assert done == [1]
    assert len(frames.state) == len(clip.keypoints)
    assert (frames.labels == clip.labels).all()
    assert frames.probabilities.shape == (len(clip.keypoints), STEPS, 3)
    assert frames.state[0] == "DISARMED"
    assert {"GUARD", "ARREST"} & set(frames.state[clip.labels == 2])


def test_tracks_of_eight_keypoints_leave_elbows_and_wrists_open(tmp_path):
    (tmp_path / "urfd").mkdir()
    seen = np.random.default_rng(0).random((40, 8, 2))
    held = np.arange(40) >= 30
    tracks = {f"{name}/keypoints8": seen for name in ("seg00_adl-01", "seg38_adl-40")}
    tracks |= {f"{name}/held": held for name in ("seg00_adl-01", "seg38_adl-40")}
    np.savez(tmp_path / "urfd" / "adls.npz", **tracks)
    (clip,) = read_partial(tmp_path)  # adl-40 is learnt from by its exact track
    assert clip.name == "seg00_adl-01/eight"
    assert clip.keypoints.shape == (40, 12, 3)
    assert np.isnan(clip.keypoints[:, 2:6]).all()
    assert np.isfinite(clip.keypoints[:30, [0, 1, 6, 7, 8, 9, 10, 11]]).all()
    assert np.isnan(clip.keypoints[30:]).all()
    assert clip.keypoints[:30, 0, 0] == pytest.approx(seen[:30, 0, 0] * 320)
    assert clip.labels is None
