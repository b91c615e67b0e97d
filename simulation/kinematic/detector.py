"""The noise of a pose estimator, put onto exact projections.

Sizes are in trunk lengths, so that they do not depend on the resolution. Estimators were seen to agree within
2.4 to 4.9 px on upright people of 90 to 170 px, and within 13 to 24 px on lying ones: what is
assumed here reproduces that spread, most of it as an error that wanders over a third of a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perception.skeleton import MIRROR
from simulation.kinematic.body import Floats


@dataclass(frozen=True, slots=True)
class Detector:
    """How a pose estimator errs; 0 everywhere is a perfect one."""

    wander: float = 0.035  # slow error per axis [trunk lengths]
    jitter: float = 0.012  # from frame to frame, per axis [trunk lengths]
    memory_s: float = 0.3  # time constant of the slow error [s]
    far_side: float = 1.4  # errors of the far body side, which the body covers
    lying: float = 2.5  # errors of a lying body
    misplaced_hz: float = 0.10  # per keypoint: lapses that put it elsewhere
    misplaced_s: float = 0.1  # duration of a lapse [s]
    misplaced: float = 0.5  # error during a lapse, per axis [trunk lengths]
    dropped: float = 0.01  # share of keypoints not found
    missed: float = 0.005  # share of frames without any person
    confidence: float = 0.78  # of an upright, well seen point

    def observe(self, seen: Floats, fps: float, rng: np.random.Generator) -> Floats:
        """Return what the estimator reports: (T, 12, 3) x, y [px], confidence; NaN and 0 where nothing was found.

        Args:
            seen: (T, 12, 3) exact x, y [px] and depth [m].
            fps: frame rate [Hz].
            rng: all of it is drawn from here, in a fixed order.
        """
        frames = len(seen)
        exact, depth = seen[..., :2], seen[..., 2]
        trunk = exact[:, 0:2].mean(axis=1) - exact[:, 6:8].mean(axis=1)
        length = float(np.nanmedian(np.linalg.norm(trunk, axis=-1)))
        level = np.abs(trunk[:, 0]) / np.maximum(np.linalg.norm(trunk, axis=-1), 1e-9)
        worse = 1.0 + (self.lying - 1.0) * level[:, None] ** 2 * np.ones(12)
        worse = worse * np.where(depth > depth[:, MIRROR], self.far_side, 1.0)
        slow = _coloured(rng.normal(size=(frames, 12, 2)), np.exp(-1.0 / (fps * self.memory_s)))
        fast = rng.normal(size=(frames, 12, 2))
        lapsed = self._lapses(rng.random((frames, 12)), fps)
        elsewhere = _held(rng.normal(size=(frames, 12, 2)), lapsed)
        error = worse[..., None] * (self.wander * slow + self.jitter * fast)
        error = np.where(lapsed[..., None], self.misplaced * elsewhere, error)
        spread = 0.10 * rng.normal(size=(frames, 12))
        confidence = np.clip(self.confidence / np.sqrt(worse) + spread, 0.15, 0.97)
        confidence = np.where(lapsed, 0.5 * confidence, confidence)
        lost = (rng.random((frames, 12)) < self.dropped) | (rng.random(frames) < self.missed)[:, None]
        lost |= ~np.isfinite(exact).all(axis=-1)
        reported = np.concatenate([exact + length * error, confidence[..., None]], axis=-1)
        reported[lost] = (np.nan, np.nan, 0.0)
        return reported

    def _lapses(self, draw: Floats, fps: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        begins = draw < self.misplaced_hz / fps
        lapsed = begins.copy()
        for delay in range(1, max(round(self.misplaced_s * fps), 1)):
            lapsed[delay:] |= begins[:-delay]
        return lapsed


def _coloured(white: Floats, memory: float) -> Floats:
    """Colour white noise (T, ...) to first order, keeping unit variance."""
    coloured = white.copy()
    innovation = np.sqrt(1.0 - memory**2)
    for frame in range(1, len(white)):
        coloured[frame] = memory * coloured[frame - 1] + innovation * white[frame]
    return coloured


def _held(values: Floats, lapsed: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Floats:
    """Return `values` (T, 12, 2) with the one at the start of each lapse kept through it."""
    held = values.copy()
    for frame in range(1, len(values)):
        goes_on = lapsed[frame] & lapsed[frame - 1]
        held[frame, goes_on] = held[frame - 1, goes_on]
    return held
