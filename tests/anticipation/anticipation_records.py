"""Predictions as an evaluation stores them, made up: what was said is known exactly."""

import numpy as np
from anticipation_people import falling

from anticipation.training.clips import FALL, Clip
from anticipation.training.evaluation.calibration import ahead
from anticipation.training.evaluation.examination import SHIFTED
from anticipation.training.evaluation.records import Frames, Predictions, Record, Ticks
from anticipation.training.evaluation.stream import centres, cleaned, ticked_labels, whole, whole_windows
from bridge.config.perception import CleaningConfig
from perception.features import relative

PLANE = {
    "centres": np.array([[3.0, 0.0], [0.0, 1.0], [-3.0, 0.0]]),
    "weights": np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]),
    "biases": np.zeros(3),
}


def seen(clip: Clip, confidence: float = 0.9, wrong: float = 0.0, seed: int = 0) -> Ticks:
    """What a network would say that knows the future but errs in a share of the steps, and of the keypoints by 0.05."""
    rng = np.random.default_rng(seed)
    messages = cleaned(clip, CleaningConfig())
    labels = ticked_labels(clip, messages)
    there = np.array([whole(message) for message in messages])
    poses = np.array([relative(message.position_px, message.body_length_px) for message in messages], dtype=np.float32)
    tested = whole_windows(there)
    truth = np.maximum(ahead(labels), 0)
    said = np.where(rng.random(truth.shape) < wrong, (truth + 1) % 3, truth)
    probabilities = np.where(np.arange(3) == said[..., None], confidence, (1 - confidence) / 2)
    later = np.minimum(np.arange(len(messages))[:, None] + np.arange(1, 16), len(messages) - 1)
    lying = int(np.argmax(labels == FALL)) if (labels == FALL).any() else len(labels)
    distance = (lying - np.arange(len(messages)))[:, None] / 10 - np.arange(16) / 10
    return Ticks(
        stamps_ns=np.array([message.stamp_ns for message in messages]),
        labels=labels,
        tested=tested,
        whole=there,
        poses=poses,
        centre_px=centres(messages),
        body_px=np.array([message.body_length_px for message in messages], dtype=np.float32),
        valid=tested.copy(),
        quality=np.ones(len(messages), dtype=np.float32),
        probabilities=probabilities.astype(np.float32),
        distance=distance.astype(np.float32),
        plane=np.stack([distance, np.zeros_like(distance)], axis=-1).astype(np.float32),
        forecast=(poses[later] + rng.normal(0, 0.04, (*later.shape, 12, 2))).astype(np.float16),
        rows={
            SHIFTED: np.where(rng.random(truth.shape) < 0.5, truth, 0).astype(np.int8),
            "zero velocity + DGNN": np.repeat(truth[:, :1], 16, axis=1).astype(np.int8),
        },
        planes={"PCA, window": np.stack([distance[:, 0], truth[:, 0]], axis=1).astype(np.float32)},
    )


def clip_of(seed: int, name: str = "", source: str = "URFD", group: str = "") -> Clip:
    keypoints, labels = falling(seed)
    name = name or f"fall-{seed:02d}/alphapose"
    return Clip(name, group or name, keypoints, 30.0, labels + 1, 320, 240, source, "made")


def frames(labels, states, fps: float = 30.0) -> Frames:
    """Frames with given labels and states; everything else says nothing."""
    count = len(labels)
    return Frames(
        stamps_ns=np.round(np.arange(count) * 1e9 / fps).astype(np.int64),
        labels=np.asarray(labels, dtype=np.int64),
        state=np.array(states, dtype="<U9"),
        stiffening=np.zeros(count, dtype=np.float32),
        quality=np.ones(count, dtype=np.float32),
        probabilities=np.full((count, 16, 3), 1 / 3, dtype=np.float32),
        distance=np.zeros((count, 16), dtype=np.float32),
    )


def alarmed(labels, at: int) -> Frames:
    """Frames whose states are FOLLOW, from `at` on GUARD and a third of a second later ARREST."""
    states = ["FOLLOW"] * at + ["GUARD"] * 10 + ["ARREST"] * len(labels)
    return frames(labels, states[: len(labels)])


def made_predictions(parts: int = 2, falls: int = 4, wrong: float = 0.1) -> Predictions:
    """An evaluation of some URFD falls, one UP-Fall fall and some daily life, by two parts."""
    records = []
    for number in range(falls):
        clip = clip_of(number)
        watched = alarmed(clip.labels, int(np.argmax(clip.labels == 1)) + 5)
        ticks = seen(clip, wrong=wrong, seed=number)
        records.append(Record(clip.name, clip.group, "URFD", "fall", number % parts, ticks, watched))
    staged = clip_of(20, "activity01-trial1-cam1", "UP-Fall")
    watched = alarmed(staged.labels, 50)
    records.append(Record(staged.name, staged.group, "UP-Fall", "staged", 0, seen(staged), watched))
    calm = frames(np.zeros(300), ["FOLLOW"] * 300)
    records.append(Record("activity06-trial1-cam1", "g", "UP-Fall", "daily", 1, None, calm))
    records.append(Record("seg00_adl-01/eight", "h", "URFD", "partial", 0, None, alarmed(np.zeros(300), 200)))
    records.append(Record("01_01/camera-3", "i", "cmu", "walk", 0, None, calm))
    meta = {
        "protocol": "grouped", "seed": 0, "parts": [f"fold {part + 1}" for part in range(parts)],
        "keypoints": "alphapose", "forecaster": "dct_mlp",
    }  # fmt: skip
    return Predictions(meta, records, [PLANE] * parts)
