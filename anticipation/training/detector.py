"""The noise of a pose estimator, put onto perfect projections.

Measured on the standing and falling frames of the 24 URFD falls, in torso lengths: AlphaPose and MoveNet differ by
0.04 to 0.09 per axis (robust standard deviation; wrists, hips, knees and ankles worst, the far side of the body a
third worse), of which 0.012 (AlphaPose) to 0.032 (MoveNet) changes from frame to frame and the rest wanders slowly;
1 to 13 % of the points lie more than half a torso apart (shoulders least, ankles most); 1 to 11 % of MoveNet's
confidences are below 0.2.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from bridge.messages import KEYPOINTS, Floats

WANDER: Final = np.array([5.0, 5.6, 4.2, 6.6, 4.7, 6.8, 5.6, 7.7, 5.4, 7.6, 6.3, 8.7]) * 0.01 / np.sqrt(2)
JITTER: Final = (0.011, 0.035)
MISPLACED: Final = np.array([0.9, 1.6, 2.4, 3.4, 4.7, 7.3, 2.1, 2.5, 5.1, 10.4, 6.6, 13.4]) * 0.01 / 2
CONFIDENCE: Final = np.array([0.75, 0.75, 0.75, 0.6, 0.65, 0.55, 0.8, 0.75, 0.7, 0.65, 0.65, 0.6])
MEMORY: Final = 0.9  # of the wander from frame to frame at 30 Hz: it changes over a third of a second


def observe(points: Floats, rng: np.random.Generator) -> Floats:
    """Return what an estimator would have reported of points (T, 12, 2) [px]: (T, 12, 3) px, px, confidence.

    A point that is behind the camera, or dropped, is NaN with confidence 0.
    """
    frames = len(points)
    torso = np.nanmedian(np.linalg.norm(points[:, 0:2].mean(axis=1) - points[:, 6:8].mean(axis=1), axis=-1))
    worse = np.ones(KEYPOINTS)
    worse[rng.integers(2) :: 2] = 1.3  # the side turned away
    wander = _autoregressive(rng.normal(size=(frames, KEYPOINTS, 2)), MEMORY) * (WANDER * worse)[:, None]
    jitter = rng.normal(size=(frames, KEYPOINTS, 2)) * rng.uniform(*JITTER)
    lapse = rng.random((frames, KEYPOINTS)) < MISPLACED * worse / 3  # a lapse lasts three frames on average
    away = rng.normal(size=(frames, KEYPOINTS, 2)) * 0.5
    lapsed = np.zeros((frames, KEYPOINTS), dtype=bool)
    for delay in range(3):
        lapsed[delay:] |= lapse[: frames - delay]
    noisy = points + torso * (wander + jitter + away * lapsed[..., None])
    confidence = np.clip(rng.normal(CONFIDENCE, 0.12, size=(frames, KEYPOINTS)) - 0.3 * lapsed, 0.05, 0.95)
    confidence[~np.isfinite(noisy).all(axis=-1)] = 0.0
    return np.concatenate([noisy, confidence[..., None]], axis=-1)


def _autoregressive(white: Floats, memory: float) -> Floats:
    """Colour white noise (T, ...) to first order, keeping unit variance."""
    coloured = white.copy()
    innovation = np.sqrt(1.0 - memory**2)
    for frame in range(1, len(white)):
        coloured[frame] = memory * coloured[frame - 1] + innovation * white[frame]
    return coloured
