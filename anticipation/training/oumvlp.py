"""OUMVLP-Pose: 10,307 people walk past cameras at fourteen angles, tracked by OpenPose and by AlphaPose.

An et al., "Performance Evaluation of Model-Based Gait on Multi-View Very Large Population Database with Pose
Sequences", IEEE T-BIOM 2020. The published layout, under `oumvlp/` in the data folder, one JSON file a frame:

    oumvlp/alphapose/00001/030_00/0012_keypoints.json      estimator, person, angle_walk, frame
    oumvlp/alphapose/00001/00/030/0012_keypoints.json      the same, as OpenGait rearranges it: person, walk, angle

A file holds `{"people": [{"pose_keypoints_2d": [x, y, confidence, ...]}]}` with the 18 keypoints of OpenPose's COCO
model: nose, neck, right shoulder, elbow, wrist, left shoulder, elbow, wrist, right hip, knee, ankle, left hip, knee,
ankle, eyes, ears. `people` is empty where nobody was found, and a keypoint that was not found is zero.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np

from anticipation.training.clips import STABLE, Clip
from bridge.errors import SourceError
from bridge.messages import Floats

FOLDER: Final = "oumvlp"
SOURCE: Final = "OUMVLP-Pose"
LICENCE: Final = "research use, by agreement with Osaka University"
FPS: Final = 25.0
WIDTH: Final = 1280
HEIGHT: Final = 980
KEYPOINTS_18: Final = 18
OURS: Final = np.array([5, 2, 6, 3, 7, 4, 11, 8, 12, 9, 13, 10])  # our twelve among the eighteen
LONGEST: Final = 1000  # frames a sequence may span; the published ones have 18 to 35

Estimator = Literal["alphapose", "openpose"]
ESTIMATORS: Final[tuple[Estimator, ...]] = get_args(Estimator)


def is_there(folder: Path, estimator: Estimator) -> bool:
    """Tell whether the data folder holds this estimator's sequences."""
    return (folder / FOLDER / estimator).is_dir()


def read(folder: Path, estimator: Estimator, clips: int, seed: int) -> list[Clip]:
    """Read up to `clips` sequences, drawn at random over people and angles. Everybody walks: 'stable'.

    Raises:
        SourceError: the folder is missing, or a file is not what it should be.
    """
    root = folder / FOLDER / estimator
    if not root.is_dir():
        raise SourceError(f"research data is incomplete: '{FOLDER}/{estimator}' is not in '{folder}'")
    people = sorted(path for path in root.iterdir() if path.is_dir())
    order = np.random.default_rng(seed).permutation(len(people))
    found: list[Clip] = []
    # one sequence of each person before the second of any, so that a few clips are many people
    waiting = [_shuffled(people[index], seed) for index in order]
    while waiting and len(found) < clips:
        for sequences in list(waiting):
            place = next(sequences, None)
            if place is None:
                waiting.remove(sequences)
            elif len(found) < clips:
                found.append(_clip(*place, estimator))
    return found


def sequences(person: Path) -> list[tuple[Path, str, str, str]]:
    """Return folder, person, angle and walk of every sequence of one person, in either layout."""
    found = []
    for outer in sorted(path for path in person.iterdir() if path.is_dir()):
        angle, _, walk = outer.name.partition("_")
        if walk:
            found.append((outer, person.name, angle, walk))
        else:
            inner = sorted(path for path in outer.iterdir() if path.is_dir())
            found += [(path, person.name, path.name, outer.name) for path in inner]
    return found


def _shuffled(person: Path, seed: int) -> Iterator[tuple[Path, str, str, str]]:
    found = sequences(person)
    for index in np.random.default_rng([seed, *person.name.encode()]).permutation(len(found)):
        yield found[index]


def _clip(place: Path, person: str, angle: str, walk: str, estimator: Estimator) -> Clip:
    keypoints = read_sequence(place)
    labels = np.full(len(keypoints), STABLE, dtype=np.int64)
    name = f"oumvlp-{person}-{angle}-{walk}/{estimator}"
    return Clip(name, f"oumvlp/{person}", keypoints, FPS, labels, WIDTH, HEIGHT, SOURCE, LICENCE)


def read_sequence(place: Path) -> Floats:
    """Read the frames of one sequence, (N, 12, 3) px, px, confidence; NaN where not found or no frame is there.

    Raises:
        SourceError: a file is not what it should be, or there is none.
    """
    poses = {_number(file): _pose(file) for file in sorted(place.glob("*.json"))}
    if not poses:
        raise SourceError(f"{place}: no frame of OUMVLP-Pose (NNNN_keypoints.json)")
    first, last = min(poses), max(poses)
    if last - first >= LONGEST:
        raise SourceError(f"{place}: frames {first} to {last} in one sequence, limit {LONGEST}")
    keypoints = np.full((last - first + 1, len(OURS), 3), np.nan)
    for number, pose in poses.items():
        keypoints[number - first] = pose
    return keypoints


def _number(file: Path) -> int:
    """Return the frame's number: the last in the name before '_keypoints', such as 0012_keypoints or 00001-0012."""
    found = re.findall(r"\d+", file.stem.removesuffix("_keypoints"))
    if not found:
        raise SourceError(f"{file}: no frame number in the name")
    return int(found[-1])


def _pose(file: Path) -> Floats:
    """Read our twelve keypoints of the first person in a file, (12, 3)."""
    try:
        content: Any = json.loads(file.read_bytes())
        people = content["people"]
        values = np.array(people[0]["pose_keypoints_2d"] if people else np.full(3 * KEYPOINTS_18, np.nan), dtype=float)
    except (OSError, ValueError, TypeError, KeyError, IndexError) as error:
        raise SourceError(f"{file}: not a frame of OUMVLP-Pose ({type(error).__name__}: {error})") from error
    if values.shape != (3 * KEYPOINTS_18,):
        raise SourceError(f"{file}: {values.size} numbers for one person, expected {3 * KEYPOINTS_18}")
    pose: Floats = values.reshape(KEYPOINTS_18, 3)[OURS]
    pose[pose[:, 2] == 0.0] = np.nan
    return pose
