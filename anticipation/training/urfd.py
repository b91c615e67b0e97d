"""UR Fall Detection (Kwolek and Kepski 2014): 24 falls tracked twice, one daily activity tracked exactly.

The dataset labels a frame -1 not lying, 0 falling (a fixed second), 1 lying.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal

import numpy as np

from anticipation.training.clips import STABLE, UNLABELLED, Clip, load_arrays, required

LICENCE: Final = "CC BY-NC-SA 4.0"
WIDTH: Final = 320
HEIGHT: Final = 240
FPS: Final = 30.0
EXACT: Final = "adl-40"  # the daily activity that was tracked frame by frame

Estimator = Literal["alphapose", "movenet"]


def read_falls(folder: Path, estimator: Estimator) -> list[Clip]:
    """Read the falls as one estimator tracked them; both tracks of a fall share its group.

    Raises:
        SourceError: the file is missing or damaged.
    """
    arrays = load_arrays(required(folder, "urfd/falls.npz"))
    clips = []
    for key in sorted(arrays):
        fall, _, kind = key.partition("/")
        if kind == estimator:
            labels = arrays[f"{fall}/label"].astype(np.int64) + 1
            clips.append(
                Clip(f"{fall}/{estimator}", f"urfd/{fall}", arrays[key], FPS, labels, WIDTH, HEIGHT, "URFD", LICENCE)
            )
    return clips


def read_daily(folder: Path) -> list[Clip]:
    """Read the daily activity with exact per-frame tracks (adl-40).

    The labels begin with frame 45, when the person enters, and end with the last frame.
    There 0 and 1 mean lying down on purpose. A window of someone lying is the same
    whichever way they came down, so frames from the descent on carry no label.
    `adls.npz` also holds 39 sequences of 8 keypoints without elbows and wrists, one of them of
    this very activity: these are not read, because a network that always sees 12 would learn the gap, not the person.
    """
    arrays = load_arrays(required(folder, "urfd/adls.npz"))
    track = arrays[f"{EXACT}/movenet"]
    standing = arrays[f"{EXACT}/label"].astype(np.int64) < 0
    labels = np.full(len(track), UNLABELLED, dtype=np.int64)
    labels[len(track) - len(standing) :][standing] = STABLE
    return [Clip(f"{EXACT}/movenet", f"urfd/{EXACT}", track, FPS, labels, WIDTH, HEIGHT, "URFD", LICENCE)]
