"""A pinhole camera that stands still or follows the person, as one on a walking-assist robot does.

World: x forward, y left, z up [m]. Image: x right, y down, origin at the top left corner [px].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulation.kinematic.body import Floats
from simulation.kinematic.events import STEP_S

NEAR_M = 0.1  # nothing nearer is seen


@dataclass(frozen=True, slots=True)
class Camera:
    """Where the camera is, relative to the point on the floor it belongs to, and how it sees."""

    position_m: tuple[float, float, float] = (0.0, -3.0, 1.3)  # from the followed point, or from the world's origin
    look_at_m: tuple[float, float, float] = (0.0, 0.0, 0.85)  # in the same frame
    field_of_view_rad: float = np.radians(57.0)  # horizontal
    width_px: int = 320
    height_px: int = 240
    roll_rad: float = 0.0
    follow_s: float | None = 0.6  # time constant of following; None: the camera stands still

    @property
    def focal_px(self) -> float:
        """Focal length [px]."""
        return float(0.5 * self.width_px / np.tan(0.5 * self.field_of_view_rad))

    def axes(self) -> Floats:
        """Return the rotation from world to camera axes (x right, y down, z ahead), (3, 3)."""
        ahead = np.subtract(self.look_at_m, self.position_m)
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        down = np.cross(ahead, right)
        turn = np.array(
            [
                [np.cos(self.roll_rad), np.sin(self.roll_rad), 0.0],
                [-np.sin(self.roll_rad), np.cos(self.roll_rad), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        return np.asarray(turn @ np.stack([right, down, ahead]))

    def project(self, world_m: Floats, anchor_m: Floats) -> Floats:
        """Return image points and depths of world points.

        Args:
            world_m: (T, N, 3) [m].
            anchor_m: (T, 2) point on the floor that the camera belongs to [m], from `anchor`.

        Returns:
            (T, N, 3) x, y [px], depth [m]; NaN where a point is behind the camera.
        """
        origin = np.concatenate([anchor_m, np.zeros((len(anchor_m), 1))], axis=1) + self.position_m
        seen = (world_m - origin[:, None]) @ self.axes().T
        depth = np.where(seen[..., 2] > NEAR_M, seen[..., 2], np.nan)
        centre = 0.5 * np.array([self.width_px, self.height_px])
        image = centre + self.focal_px * seen[..., :2] / depth[..., None]
        return np.concatenate([image, depth[..., None]], axis=-1)

    def anchor(self, path_m: Floats, step_s: float = STEP_S) -> Floats:
        """Return the point on the floor (T, 2) that the camera belongs to while a person takes `path_m` (T, 2).

        A following camera lags: second order, critically damped, at rest relative to the person at the start.
        """
        if self.follow_s is None:
            return np.zeros_like(path_m)
        rate = 2.0 / self.follow_s
        speed = (path_m[1] - path_m[0]) / step_s if len(path_m) > 1 else np.zeros(2)
        position = path_m[0] - 2.0 * speed / rate  # where a camera that has followed for long would be
        behind = position - path_m[0]
        anchored = np.empty_like(path_m)
        for index, target in enumerate(path_m):
            anchored[index] = position
            speed = speed + step_s * rate * (rate * (target - position) - 2.0 * speed)
            position = position + step_s * speed
        return np.asarray(anchored - behind)
