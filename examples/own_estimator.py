"""A pose estimator of your own: here one that needs no network, but a suit with twelve coloured markers.

surefoot up --source camera:0 --estimator examples/own_estimator.py:Markers

An estimator is made once, with the options of `[launch.options.perception]`, and asked for every picture. It returns
an array (12, 3) for everybody in it: x, y [px], confidence 0..1; NaN where a keypoint is not found. Cleaning, choosing
whom to follow and saying what is wrong is not its business.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bridge.messages import Floats
from perception.sources.frame import Image

COLOURS = np.array(  # RGB of the markers at shoulders, elbows, wrists, hips, knees and ankles, left before right
    [
        (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0), (255, 0, 255), (0, 255, 255),
        (255, 128, 0), (128, 0, 255), (0, 255, 128), (128, 255, 0), (255, 0, 128), (0, 128, 255),
    ],
    dtype=np.int16,
)  # fmt: skip


class Markers:
    """Finds the middle of each colour; a marker that covers `full_px` pixels is quite sure."""

    def __init__(self, options: Mapping[str, str]) -> None:
        self._tolerance = int(options.get("tolerance", "40"))  # largest difference in each of R, G, B
        self._full_px = float(options.get("full_px", "20"))

    def estimate(self, image_rgb: Image) -> list[Floats]:
        """Return one person, or nobody where fewer than four markers are seen."""
        person = np.full((12, 3), np.nan)
        for row, colour in zip(person, COLOURS, strict=True):
            y, x = np.nonzero((np.abs(image_rgb.astype(np.int16) - colour) <= self._tolerance).all(axis=2))
            if len(x):
                row[:] = x.mean(), y.mean(), min(1.0, len(x) / self._full_px)
        return [person] if np.count_nonzero(np.isfinite(person[:, 0])) >= 4 else []
