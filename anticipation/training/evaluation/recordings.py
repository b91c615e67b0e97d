"""What is tested, clip by clip, as it was filmed; `corpus` holds the same people cleaned, to learn from."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from anticipation.training import mocap, upfall, urfd
from anticipation.training.clips import Clip, load_arrays, required
from anticipation.training.corpus import Corpus
from anticipation.training.evaluation.records import Kind
from perception.skeleton import L_ANKLE, L_HIP, L_KNEE, L_SHOULDER, R_ANKLE, R_HIP, R_KNEE, R_SHOULDER

SEEN_OF_EIGHT: Final = (L_SHOULDER, R_SHOULDER, L_HIP, R_HIP, L_KNEE, R_KNEE, L_ANKLE, R_ANKLE)
CONFIDENT: Final = 0.8  # the eight-keypoint tracks carry no confidence


class Recording(NamedTuple):
    """A clip and what it shows."""

    clip: Clip
    kind: Kind


def read_recordings(folder: Path, corpus: Corpus, mocap_clips: int, seed: int) -> list[Recording]:
    """Read every filmed person and the mocap clips that no network learns from.

    Raises:
        SourceError: a file is missing or damaged.
    """
    kept = {track.name for track in corpus.kept_walks}
    falls = [clip for estimator in ("alphapose", "movenet") for clip in urfd.read_falls(folder, estimator)]
    staged = upfall.read(folder)
    walks = [clip for clip in mocap.read(folder, mocap_clips, seed) if clip.name in kept]
    return [
        *(Recording(clip, "fall") for clip in falls),
        *(Recording(clip, "staged" if upfall.is_fall(clip) else "daily") for clip in staged),
        *(Recording(clip, "daily") for clip in urfd.read_daily(folder)),
        *(Recording(clip, "partial") for clip in read_partial(folder)),
        *(Recording(clip, "walk") for clip in walks),
    ]


def read_partial(folder: Path) -> list[Clip]:
    """Read the URFD daily activities of which eight keypoints are known: no elbows, no wrists, no labels.

    The one that networks learn from by its exact track is left out, or they would be tested on what they know.
    Frames in which the estimator held an old pose count as not seen.

    Raises:
        SourceError: the file is missing or damaged.
    """
    arrays = load_arrays(required(folder, "urfd/adls.npz"))
    size = np.array([urfd.WIDTH, urfd.HEIGHT])
    clips = []
    for key in sorted(arrays):
        name, _, kind = key.partition("/")
        if kind != "keypoints8" or name.rpartition("_")[2] == urfd.EXACT:
            continue
        seen = np.where(arrays[f"{name}/held"].astype(bool)[:, None, None], np.nan, arrays[key] * size)
        keypoints = np.full((len(seen), 12, 3), np.nan)
        keypoints[:, SEEN_OF_EIGHT, :2] = seen
        keypoints[:, SEEN_OF_EIGHT, 2] = np.where(np.isfinite(seen).all(axis=-1), CONFIDENT, np.nan)
        group = f"urfd/{name}"
        clips.append(
            Clip(f"{name}/eight", group, keypoints, urfd.FPS, None, urfd.WIDTH, urfd.HEIGHT, "URFD", urfd.LICENCE)
        )
    return clips
