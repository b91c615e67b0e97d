"""A depth camera or a tracker that knows its keypoints in space: they are projected into a picture.

surefoot up --source examples/depth_camera.py:frames

Replace `StandIn` by your camera's SDK. Space is the camera's: x right, y down, z away from the lens [m], as the
"optical frame" of ROS has it. The networks read pictures, so the points are seen through a pinhole where the camera is.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from bridge.clock import NS, Clock
from bridge.errors import SourceError
from bridge.messages import Floats
from perception.sources.frame import Frame

NEAREST_M = 0.2


class Pinhole(NamedTuple):
    """What a calibration gives, without lens distortion."""

    focal_px: float
    width_px: int
    height_px: int

    def project(self, points_m: Floats) -> Floats:
        """Return (12, 3) x, y [px], confidence of (12, 4) x, y, z [m], confidence; NaN where there is no point.

        u = f x / z + w / 2, v = f y / z + h / 2. A point behind the lens or nearer than 0.2 m is none.
        """
        x, y, z, confidence = points_m.T
        z = np.where(z >= NEAREST_M, z, np.nan)
        u = self.focal_px * x / z + self.width_px / 2
        v = self.focal_px * y / z + self.height_px / 2
        return np.column_stack((u, v, np.where(np.isnan(u + v), 0.0, confidence)))


class StandIn:
    """A person 2.5 m in front of the camera who shifts from foot to foot; twelve points, thirty times a second."""

    STANDING = np.array(  # x, y [m] of the shoulders, elbows, wrists, hips, knees, ankles; left is the person's
        [
            (0.18, -0.55), (-0.18, -0.55), (0.24, -0.27), (-0.24, -0.27), (0.25, 0.0), (-0.25, 0.0),
            (0.12, 0.0), (-0.12, 0.0), (0.12, 0.45), (-0.12, 0.45), (0.12, 0.88), (-0.12, 0.88),
        ]
    )  # fmt: skip

    def read(self, time_s: float) -> Floats:
        """Return (12, 4) x, y, z [m], confidence 0..1."""
        sway = 0.04 * np.sin(2.0 * np.pi * 0.5 * time_s) * (0.88 - self.STANDING[:, 1]) / 1.43  # nothing at the ankles
        x = self.STANDING[:, 0] + sway
        return np.column_stack((x, self.STANDING[:, 1], np.full(12, 2.5), np.full(12, 0.9)))


def frames(clock: Clock, options: Mapping[str, str]) -> Iterator[Frame]:
    """Give a frame for every reading of the camera; options: `focal_px`, `width_px`, `height_px`."""
    lens = pinhole(options)
    camera, start_ns = StandIn(), clock.now_ns()
    while True:
        stamp_ns = clock.now_ns()  # better: the exposure, if your camera tells it on this clock
        points_m = camera.read((stamp_ns - start_ns) / NS)
        yield Frame(stamp_ns, lens.width_px, lens.height_px, None, (lens.project(points_m),))
        time.sleep(1 / 30)  # your camera waits for you


def pinhole(options: Mapping[str, str]) -> Pinhole:
    """Return the lens that the options describe.

    Raises:
        SourceError: a value is no number.
    """
    try:
        return Pinhole(
            float(options.get("focal_px", "420")),
            int(options.get("width_px", "640")),
            int(options.get("height_px", "480")),
        )
    except ValueError as error:
        raise SourceError(f"perception option focal_px, width_px or height_px: {error}") from error
