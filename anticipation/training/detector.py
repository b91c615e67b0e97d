"""The noise of a pose estimator, put onto perfect projections.

Measured where AlphaPose and MoveNet saw the same 24 URFD falls, on standing and falling frames, in torso lengths
(`detector_statistics` measures it again). They differ by 0.04 to 0.09 per axis (robust standard deviation; wrists,
hips, knees and ankles worst, the far side of the body a third worse), of which 0.014 (AlphaPose) to 0.033 (MoveNet)
changes from frame to frame and the rest wanders slowly. 1 to 15 % of the points lie more than half a torso apart
(shoulders least, ankles most, the far side twice as often). Where left and right are apart in the image, one of the two
has the knees exchanged in 2 % of the frames, the ankles in 1 %, the arms in less than 0.3 %, shoulders and hips all
but never; mostly for a single frame. 1 to 11 % of the confidences are below 0.2, and AlphaPose finds nobody in
0.6 % of the frames once it has begun. Each estimator is given half of what two differ by.

Six numbers are for shoulders, elbows, wrists, hips, knees, ankles: the mean of left and right.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from bridge.messages import KEYPOINTS, Floats
from perception.skeleton import MIRROR

SPREAD: Final = np.array([5.3, 5.4, 5.8, 6.6, 6.5, 7.5]) * 0.01  # of the difference of two, per axis
JITTER: Final = (0.014, 0.033)  # of one, from frame to frame
MISPLACED: Final = np.array([1.3, 3.3, 6.4, 2.5, 8.5, 11.0]) * 0.01  # two are more than half a torso apart
SWAPPED: Final = np.array([0.0, 0.1, 0.3, 0.1, 1.7, 1.2]) * 0.01  # one of two has left and right exchanged
FAINT: Final = np.array([1.2, 2.4, 4.8, 2.0, 5.7, 6.9]) * 0.01  # confidence below 0.2, mean of two
BLIND: Final = 0.006  # frames in which one of two finds nobody
SIDES: Final = (0.87, 1.13)  # spread of the near and of the far side, over their mean
LAPSING: Final = (0.65, 1.35)  # the same of misplaced and faint points
FAR_OFF: Final = 0.72  # share of the lapses drawn here that lie more than half a torso away
CONFIDENCE: Final = np.array([0.75, 0.75, 0.75, 0.6, 0.65, 0.55, 0.8, 0.75, 0.7, 0.65, 0.65, 0.6])
MEMORY: Final = 0.9  # of the wander from frame to frame at 30 Hz: it changes over a third of a second
LAPSE: Final = 3  # frames that a misplaced or faint point stays so
SWAP: Final = 1.3  # frames that a pair stays exchanged, on average
BLINK: Final = 2  # frames in a row without anybody
_WANDER: Final = np.sqrt(SPREAD**2 / 2 - np.mean(np.square(JITTER)))  # what is left of the spread when jitter is added


def observe(points: Floats, rng: np.random.Generator) -> Floats:
    """Return what an estimator would have reported of points (T, 12, 2) [px]: (T, 12, 3) px, px, confidence.

    A point that is behind the camera, or in a frame in which nobody is found, is NaN with confidence 0.
    """
    frames = len(points)
    torso = np.nanmedian(np.linalg.norm(points[:, 0:2].mean(axis=1) - points[:, 6:8].mean(axis=1), axis=-1))
    far = (np.arange(KEYPOINTS) + rng.integers(2)) % 2  # the side turned away
    spread, lapsing = np.repeat(_WANDER, 2) * np.take(SIDES, far), np.take(LAPSING, far)
    wander = _autoregressive(rng.normal(size=(frames, KEYPOINTS, 2)), MEMORY) * spread[:, None]
    jitter = rng.normal(size=(frames, KEYPOINTS, 2)) * rng.uniform(*JITTER)
    lapsed = _spells(np.repeat(MISPLACED / 2 / FAR_OFF, 2) * lapsing, LAPSE, (frames, KEYPOINTS), rng)
    away = rng.normal(size=(frames, KEYPOINTS, 2)) * 0.5
    noisy = _swapped(points, rng) + torso * (wander + jitter + away * lapsed[..., None])
    confidence = np.clip(rng.normal(CONFIDENCE, 0.12, size=(frames, KEYPOINTS)) - 0.3 * lapsed, 0.2, 0.95)
    faint = _spells(np.repeat(FAINT, 2) * lapsing, LAPSE, (frames, KEYPOINTS), rng)
    confidence[faint] = rng.uniform(0.05, 0.2, size=int(faint.sum()))
    noisy[_spells(np.array(BLIND / 2), BLINK, (frames,), rng)] = np.nan
    confidence[~np.isfinite(noisy).all(axis=-1)] = 0.0
    return np.concatenate([noisy, confidence[..., None]], axis=-1)


def _swapped(points: Floats, rng: np.random.Generator) -> Floats:
    """Exchange left and right of some pairs for a frame or two."""
    frames = len(points)
    pairs = _spells(SWAPPED / 2 / SWAP, 1, (frames, len(SWAPPED)), rng)
    longer = rng.random(pairs.shape) < SWAP - 1.0
    pairs[1:] |= pairs[:-1] & longer[1:]
    exchanged = np.repeat(pairs, 2, axis=1)[..., None]  # (T, 12, 1): the points of a pair stand side by side
    return np.where(exchanged, points[:, MIRROR], points)


def _spells(share: Floats, length: int, shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw flags that stay up for `length` frames each, for about this share of the frames."""
    begin = rng.random(shape) < share / length
    up = np.zeros(shape, dtype=bool)
    for delay in range(length):
        up[delay:] |= begin[: shape[0] - delay]
    return up


def _autoregressive(white: Floats, memory: float) -> Floats:
    """Colour white noise (T, ...) to first order, keeping unit variance."""
    coloured = white.copy()
    innovation = np.sqrt(1.0 - memory**2)
    for frame in range(1, len(white)):
        coloured[frame] = memory * coloured[frame - 1] + innovation * white[frame]
    return coloured
