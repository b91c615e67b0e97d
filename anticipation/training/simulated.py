"""Simulated people (`surefoot clips`): what a camera on the walker saw of falls that a harness held.

In the research data 'fall' is lying on the floor. In a harness nobody gets that far, and who waits for it waits until
the strap has done the work. So the states of a simulated clip are those of somebody who would fall if nobody helped,
which is known, because each was tried without help:

    stable      until the disturbance shows, and all the time of who stays up without help, stumbles included
    transient   from there on, while the body is still up
    fall        from when it comes down (the beginning of the descent that takes it `LOW_M` below standing), or hangs
                in the harness with `HANGS_WEIGHTS` of its weight

'Shows' is the first moment at which a keypoint is 5 cm from where it would have been without the disturbance: before
that no camera can know. What comes after somebody was put back on their feet carries no label, nor what a
person does who was meant to stay up and touched the floor or hung in the harness with all their weight.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Arrays, Clip, Labels, load_arrays
from bridge.errors import SourceError
from bridge.messages import Floats

SOURCE: Final = "simulated"
LICENCE: Final = "Apache-2.0"
LOW_M: Final = 0.04  # below standing height: a descent, as the campaign measures it
HANGS_WEIGHTS: Final = 0.4  # of the person's weight in the harness: without it they would be on their way down
UP_AGAIN_WEIGHTS: Final = 0.2
RISES_M: Final = 0.003  # by which the pelvis must rise in a frame to count as not coming down
SHOWN_FOR_S: Final = 1.5  # a disturbance that brings nobody down is over by then
ALL_THEIR_WEIGHTS: Final = 1.0
BEFORE_ACCIDENT_S: Final = 1.5  # of who was not meant to fall and did


def read(folder: Path) -> list[Clip]:
    """Read the clips of a folder; a scenario is a group.

    Raises:
        SourceError: there are none, or one is damaged.
    """
    if not folder.is_dir():
        raise SourceError(f"no simulated clips in '{folder}': not a folder (--simulated)")
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise SourceError(f"no simulated clips in '{folder}': make them with `surefoot clips --out {folder}`")
    return [_clip(path) for path in paths]


def _clip(path: Path) -> Clip:
    facts = load_arrays(path)
    fps = float(facts["fps"])
    width, height = (int(size) for size in facts["image_size"])
    name = f"{SOURCE}/{path.stem}"
    return Clip(name, name, facts["keypoints"], fps, labels(facts), width, height, SOURCE, LICENCE)


def labels(facts: Arrays) -> Labels:
    """Return the state in each frame (N,) from the facts of a clip, by the rule above."""
    drop, load = facts["drop_m"] - float(facts["lowered_m"]), facts["load_weights"]
    time_s = np.arange(len(drop)) / float(facts["fps"])
    found = np.full(len(drop), STABLE, dtype=np.int64)
    if not float(facts["fall"]):
        hangs = load >= ALL_THEIR_WEIGHTS
        accident_s = min(float(facts["touched_s"]), time_s[int(np.argmax(hangs))] if hangs.any() else np.inf)
        found[time_s > accident_s - BEFORE_ACCIDENT_S] = UNLABELLED
        return found
    shows_s = float(facts["visible_s"])
    held = (time_s >= float(facts["disturbed_s"])) & (load >= HANGS_WEIGHTS)
    found[np.maximum.accumulate(held)] = UNLABELLED  # held before anything showed
    found[time_s >= shows_s] = TRANSIENT
    down = _down(time_s, drop, load, shows_s)
    if down is None:
        found[time_s >= shows_s + SHOWN_FOR_S] = UNLABELLED
        return found
    up_again = (load < UP_AGAIN_WEIGHTS) & (drop < LOW_M)
    after = np.arange(len(drop)) >= down
    found[after] = np.where(up_again[after], UNLABELLED, FALL)
    low = drop >= LOW_M
    first_low = int(np.argmax(low & after)) if (low & after).any() else down
    found[down : first_low + 1] = FALL
    return found


def _down(time_s: Floats, drop: Floats, load: Floats, shows_s: float) -> int | None:
    """Return the first frame of the fall, or None if the person stays up."""
    shown = time_s >= shows_s
    begins = []
    low = np.flatnonzero(shown & (drop >= LOW_M))
    if len(low):
        first = int(low[0])
        while first > 0 and drop[first] - drop[first - 1] > RISES_M and shown[first - 1]:
            first -= 1
        begins.append(first)
    hangs = np.flatnonzero(shown & (load >= HANGS_WEIGHTS))
    if len(hangs):
        begins.append(int(hangs[0]))
    return min(begins) if begins else None
