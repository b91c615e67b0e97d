"""The camera on the walker: where it is, how it sees, and how a pose estimator errs on its images.

Base frame of the walker: x forward, y left, z up. Image: x right, y down, origin at the top left corner [px].
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from bridge.messages import Floats
from perception.skeleton import MIRROR

NEAR_M: Final = 0.1  # nothing nearer is seen
MARGIN_PX: Final = 2.0  # a point this far outside the picture is not reported

# Errors of one estimator in trunk lengths, as two of them differed on the same videos of falls (half of the difference
# each): see anticipation/training/detector.py. Shoulders, elbows, wrists, hips, knees, ankles.
WANDER: Final = np.repeat((0.037, 0.038, 0.041, 0.046, 0.046, 0.053), 2)
JITTER: Final = 0.024
LAPSES: Final = np.repeat((0.9, 2.3, 4.4, 1.7, 5.9, 7.6), 2) * 0.01  # share of frames in which a point is elsewhere
LAPSE_FRAMES: Final = 3
SWAPS: Final = (0.0, 0.0005, 0.0015, 0.0005, 0.0085, 0.006)  # share of frames in which a pair is exchanged
BLIND: Final = 0.003  # share of frames in which nobody is found
CONFIDENCE: Final = np.repeat((0.75, 0.66, 0.60, 0.77, 0.68, 0.62), 2)
MEMORY_S: Final = 0.32  # over which the slow error wanders
FAR_SIDE: Final = 1.3  # errors of a point that the body covers


@dataclass(frozen=True, slots=True)
class RobotCamera:
    """Pose in the walker's base frame, lens and timing."""

    position_m: tuple[float, float, float] = (1.30, 0.0, 1.10)
    look_at_m: tuple[float, float, float] = (0.0, 0.0, 0.80)
    field_of_view_deg: float = 78.0  # horizontal
    width_px: int = 320
    height_px: int = 320
    rate_hz: float = 30.0
    latency_s: float = 0.020  # from exposure to the estimator's answer

    @property
    def focal_px(self) -> float:
        """Focal length [px]."""
        return float(0.5 * self.width_px / np.tan(np.radians(0.5 * self.field_of_view_deg)))

    def project(self, world_m: Floats, base: tuple[float, float, float]) -> tuple[Floats, Floats]:
        """Return image points (N, 2) [px] and depths (N,) [m] of world points (N, 3); NaN behind the camera.

        Args:
            world_m: points in the world [m].
            base: x, y [m] and yaw [rad] of the walker.
        """
        c, s = cos(base[2]), sin(base[2])
        x, y = world_m[:, 0] - base[0], world_m[:, 1] - base[1]
        points = np.column_stack((c * x + s * y, c * y - s * x, world_m[:, 2])) - self.position_m
        ahead = np.subtract(self.look_at_m, self.position_m)
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right = right / np.linalg.norm(right)
        seen = points @ np.stack((right, np.cross(ahead, right), ahead)).T
        depth = np.where(seen[:, 2] > NEAR_M, seen[:, 2], np.nan)
        centre = 0.5 * np.array([self.width_px, self.height_px])
        return centre + self.focal_px * seen[:, :2] / depth[:, None], depth


class Detection(NamedTuple):
    """What an estimator reports of one frame."""

    points: Floats  # (12, 3) x, y [px], confidence; NaN and 0 where nothing was found
    found: bool  # whether anybody was


class Detector:
    """A pose estimator's errors, one frame after another, from one generator of random numbers."""

    def __init__(self, camera: RobotCamera, rng: np.random.Generator) -> None:
        self._camera, self._rng = camera, rng
        self._memory = float(np.exp(-1.0 / (camera.rate_hz * MEMORY_S)))
        self._slow = rng.normal(size=(12, 2))
        self._lapse = np.zeros(12, dtype=np.int64)  # frames left
        self._elsewhere = np.zeros((12, 2))

    def observe(self, points_px: Floats, depth_m: Floats) -> Detection:
        """Return the report of exact points (12, 2) [px] and their depths (12,) [m]."""
        rng, camera = self._rng, self._camera
        self._slow = self._memory * self._slow + sqrt(1.0 - self._memory**2) * rng.normal(size=(12, 2))
        jitter = JITTER * rng.normal(size=(12, 2))
        begins = (self._lapse == 0) & (rng.random(12) < LAPSES / LAPSE_FRAMES)
        fresh = 0.5 * rng.normal(size=(12, 2))
        self._elsewhere[begins] = fresh[begins]
        self._lapse = np.where(begins, LAPSE_FRAMES, np.maximum(self._lapse - 1, 0))
        lapsed = self._lapse > 0
        trunk = float(np.linalg.norm(points_px[:2].mean(axis=0) - points_px[6:8].mean(axis=0)))
        covered = depth_m > depth_m[MIRROR] + 0.05
        size = np.where(covered, FAR_SIDE, 1.0)[:, None]
        error = size * (WANDER[:, None] * self._slow + jitter)
        error = np.where(lapsed[:, None], self._elsewhere, error)
        reported = points_px + trunk * error
        swapped = rng.random(6) < SWAPS
        for pair in np.flatnonzero(swapped):
            reported[[2 * pair, 2 * pair + 1]] = reported[[2 * pair + 1, 2 * pair]]
        confidence = CONFIDENCE + 0.10 * rng.normal(size=12) - 0.3 * lapsed - 0.05 * covered
        confidence = np.clip(confidence, 0.10, 0.95)
        blind = rng.random() < BLIND
        inside = np.all(
            (reported > -MARGIN_PX) & (reported < (camera.width_px + MARGIN_PX, camera.height_px + MARGIN_PX)), axis=1
        )
        found = inside & np.isfinite(reported).all(axis=1) & (not blind)
        result = np.column_stack((reported, confidence))
        result[~found] = (np.nan, np.nan, 0.0)
        return Detection(result, bool(found.any()))
