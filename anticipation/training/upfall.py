"""UP-Fall (Martinez-Villasenor et al. 2019), subject 1, camera 1: five kinds of fall, six daily activities."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from anticipation.training.clips import FALL, TRANSIENT, UNLABELLED, Clip, Labels, load_arrays, required
from bridge.messages import Floats

LICENCE: Final = "research use"
WIDTH: Final = 640
HEIGHT: Final = 640
FALLS: Final = range(1, 6)
LYING_DOWN: Final = 11
LYING_TILT: Final = np.radians(60.0)
UPRIGHT_TILT: Final = np.radians(30.0)
FALLING_S: Final = 1.0  # how long URFD calls a fall a fall


def read(folder: Path) -> list[Clip]:
    """Read the 33 clips; the group is activity and trial.

    The labels are those of the data set, but for frames that contradict URFD's, which carry none:
    'falling' more than a second before the first lying frame (URFD's falling is the last second, UP-Fall's takes up to
    2.7 s), 'lying' with the trunk within 30 degrees of upright (the person has risen, or the estimator
    has lost them), and 'not lying' with the trunk beyond 60 degrees while lying down on purpose (activity 11).

    Raises:
        SourceError: the file is missing or damaged.
    """
    arrays = load_arrays(required(folder, "upfall/subject1_cam1.npz"))
    clips = []
    for key in sorted(arrays):
        name, _, kind = key.partition("/")
        if kind != "movenet":
            continue
        fps = float(arrays[f"{name}/fps"])
        labels = _consistent(arrays[f"{name}/label"].astype(np.int64) + 1, trunk_tilt(arrays[key]), fps, name)
        group = "upfall/" + name.rpartition("-")[0]
        clips.append(Clip(name, group, arrays[key], fps, labels, WIDTH, HEIGHT, "UP-Fall", LICENCE))
    return clips


def _consistent(labels: Labels, tilt: Floats, fps: float, name: str) -> Labels:
    """Take the labels from frames that would contradict URFD's."""
    index = np.arange(len(labels))
    first_lying = int(np.argmax(labels == FALL)) if (labels == FALL).any() else len(labels)
    early = (labels == TRANSIENT) & (index < first_lying - FALLING_S * fps)
    upright = (labels == FALL) & (tilt < UPRIGHT_TILT)
    on_purpose = (tilt > LYING_TILT) & (activity(name) == LYING_DOWN)
    return np.where(early | upright | on_purpose, UNLABELLED, labels)


def activity(name: str) -> int:
    """Return the activity's number from a clip name such as 'activity06-trial1-cam1'."""
    return int(name.removeprefix("activity")[:2])


def trunk_tilt(keypoints: Floats) -> Floats:
    """Return the angle between trunk and image vertical, (N,) [rad], 0 upright, NaN where unseen."""
    trunk = keypoints[:, 0:2, :2].mean(axis=1) - keypoints[:, 6:8, :2].mean(axis=1)
    return np.asarray(np.abs(np.arctan2(trunk[:, 0], -trunk[:, 1])))


def is_fall(clip: Clip) -> bool:
    """Tell whether the clip shows one of the five falls."""
    return activity(clip.name) in FALLS
