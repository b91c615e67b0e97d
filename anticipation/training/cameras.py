"""Virtual pinhole cameras: what a camera somewhere around a walking person would have seen.

World: metres, z up. Image: pixels, x right, y down, origin at the top left corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bridge.messages import Floats


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera; `following` keeps its offset to the person, as a robot's camera does."""

    height: float  # above the floor [m]
    distance: float  # on the floor from the point looked at [m]
    yaw: float  # direction in which the camera looks, about z [rad]
    roll: float  # about the optical axis [rad]
    field_of_view: float  # horizontal [rad]
    aim_height: float  # height of the point looked at [m]
    following: bool
    width: int = 320  # [px]
    image_height: int = 240  # [px]

    @property
    def focal_px(self) -> float:
        """Focal length [px]."""
        return float(0.5 * self.width / np.tan(0.5 * self.field_of_view))

    def rotation(self) -> Floats:
        """Return the rotation from world to camera axes (x right, y down, z forward), (3, 3)."""
        down = np.arctan2(self.height - self.aim_height, self.distance)
        ahead = np.array([np.cos(self.yaw) * np.cos(down), np.sin(self.yaw) * np.cos(down), -np.sin(down)])
        right = np.array([np.sin(self.yaw), -np.cos(self.yaw), 0.0])
        level = np.stack([right, np.cross(ahead, right), ahead])
        turn = np.array(
            [[np.cos(self.roll), np.sin(self.roll), 0], [-np.sin(self.roll), np.cos(self.roll), 0], [0, 0, 1]]
        )
        return np.asarray(turn @ level)

    def project(self, points: Floats) -> Floats:
        """Project world points (T, 12, 3) [m] to the image, (T, 12, 2) [px]; NaN behind the camera.

        A fixed camera looks at where the person's middle is halfway through the clip.
        """
        middle = points.mean(axis=1)  # (T, 3)
        target = middle.copy() if self.following else np.broadcast_to(np.median(middle, axis=0), middle.shape).copy()
        target[:, 2] = 0.0
        offset = np.array([-np.cos(self.yaw) * self.distance, -np.sin(self.yaw) * self.distance, self.height])
        seen = (points - (target + offset)[:, None]) @ self.rotation().T  # (T, 12, 3)
        depth = np.where(seen[..., 2:] > 0.1, seen[..., 2:], np.nan)
        centre = np.array([self.width / 2, self.image_height / 2])
        return np.asarray(centre + self.focal_px * seen[..., :2] / depth)


def draw_camera(rng: np.random.Generator) -> Camera:
    """Draw a camera at random: half of them low and near on a robot that follows, half fixed in a room."""
    following = bool(rng.random() < 0.5)
    return Camera(
        height=float(rng.uniform(0.3, 1.6) if following else rng.uniform(0.8, 2.6)),
        distance=float(rng.uniform(1.5, 3.0) if following else rng.uniform(3.0, 6.0)),
        yaw=float(rng.uniform(-np.pi, np.pi)),
        roll=float(np.radians(rng.normal(0.0, 3.0))),
        field_of_view=float(np.radians(rng.uniform(55.0, 90.0))),
        aim_height=float(rng.uniform(0.6, 1.2)),
        following=following,
    )
