"""UP-Fall (Martinez-Villasenor et al. 2019), subject 1, camera 1: five kinds of fall, six daily activities."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from anticipation.training.clips import UNLABELLED, Clip, load_arrays, required
from bridge.messages import Floats

LICENCE: Final = "research use"
WIDTH: Final = 640
HEIGHT: Final = 640
FALLS: Final = range(1, 6)
LYING_DOWN: Final = 11
LYING_TILT: Final = np.radians(60.0)


def read(folder: Path) -> list[Clip]:
    """Read the 33 clips; the group is activity and trial.

    The labels are those of the data set, with one exception. Activity 11 (lying down on
    purpose) is labelled 'not lying' throughout, though the person lies: two windows that
    look alike must not carry opposite labels, so its frames with the trunk more than
    60 degrees from upright carry none.

    Raises:
        SourceError: the file is missing or damaged.
    """
    arrays = load_arrays(required(folder, "upfall/subject1_cam1.npz"))
    clips = []
    for key in sorted(arrays):
        name, _, kind = key.partition("/")
        if kind != "movenet":
            continue
        labels = arrays[f"{name}/label"].astype(np.int64) + 1
        if activity(name) == LYING_DOWN:
            labels = np.where(trunk_tilt(arrays[key]) > LYING_TILT, UNLABELLED, labels)
        group = "upfall/" + name.rpartition("-")[0]
        fps = float(arrays[f"{name}/fps"])
        clips.append(Clip(name, group, arrays[key], fps, labels, WIDTH, HEIGHT, "UP-Fall", LICENCE))
    return clips


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
