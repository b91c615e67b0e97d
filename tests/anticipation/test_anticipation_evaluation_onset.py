"""The physical onset, on falls whose loss of balance is known."""

import numpy as np
import pytest
from anticipation_records import seen

from anticipation.training.clips import FALL, STABLE, TRANSIENT, Clip
from anticipation.training.evaluation.onset import dataset_onset, physical_labels, physical_onset
from anticipation.training.evaluation.records import Record
from simulation.kinematic.camera import Camera
from simulation.kinematic.detector import Detector
from simulation.kinematic.events import Sit, Stumble
from simulation.kinematic.fall import Fall
from simulation.kinematic.motion import Walker
from simulation.kinematic.recording import record


def filmed(events, seconds, seed, follows=True):
    """What an estimator sees of someone walking to whom something happens, from a random side."""
    rng = np.random.default_rng(seed)
    side, away = rng.uniform(-np.pi, np.pi), rng.uniform(2.5, 4.0)
    ahead = 0.0 if follows else 0.9 * events[0].at_s
    camera = Camera(
        position_m=(ahead + away * np.cos(side), away * np.sin(side), rng.uniform(0.6, 1.8)),
        look_at_m=(ahead, 0.0, 0.8),
        field_of_view_rad=np.radians(75.0),
        follow_s=0.6 if follows else None,
    )
    made = record(Walker(), events, seconds, camera, Detector(), 30.0, seed)
    clip = Clip("generated", "g", made.keypoints, 30.0, made.label.astype(np.int64) + 1, 320, 240, "made", "none")
    return seen(clip)


@pytest.fixture(scope="module")
def falls():
    """Falls in all directions before fixed and following cameras, each with its loss of balance and its ground [s]."""
    made = []
    for seed in range(12):
        fall = Fall(at_s=3.0 + 0.1 * seed, direction_rad=seed * np.pi / 6)
        made.append((filmed((fall,), fall.at_s + 2.5, seed, follows=seed % 2 == 0), fall))
    return made


def test_it_lies_between_the_loss_of_balance_and_the_ground(falls):
    """The descent of an inverted pendulum begins late: a median of half a second after balance is lost."""
    late = []
    for ticks, fall in falls:
        found = physical_onset(ticks)
        assert found is not None
        late.append(ticks.stamps_ns[found] / 1e9 - fall.at_s)
        assert 0.0 < late[-1] < fall.ground_s
    assert 0.3 < np.median(late) < 0.6


def test_labels_change_only_around_the_onset(falls):
    for ticks, _ in falls:
        found, lying = physical_onset(ticks), int(np.argmax(ticks.labels == FALL))
        labels = physical_labels(Record("a", "a", "s", "fall", 0, ticks))
        assert (labels[:found] == STABLE).all()
        assert (labels[found:lying] == TRANSIENT).all()
        assert (labels[lying:] == ticks.labels[lying:]).all()
        assert dataset_onset(ticks.labels) < found


@pytest.mark.parametrize("event", [Sit(at_s=2.0), Stumble(at_s=2.0)])
def test_nobody_who_does_not_come_to_lie_has_an_onset(event):
    ticks = filmed((event,), 5.0, 3)
    assert physical_onset(ticks) is None
    assert (physical_labels(Record("a", "a", "s", "daily", 0, ticks)) == ticks.labels).all()


def test_onset_of_the_data_set_is_the_first_frame_after_the_last_stable_one():
    assert dataset_onset(np.array([0, 0, 1, 1, 2, 2])) == 2
    assert dataset_onset(np.array([0, 0, -100, 1, 2, 0])) == 2
    assert dataset_onset(np.array([1, 2])) == 0
    assert dataset_onset(np.array([0, 1, 1])) is None
