"""The square part of an image that a single-person network looks at."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from bridge.messages import Floats
from perception.sources.frame import Image

_SHOULDERS: Final = [5, 6]
_HIPS: Final = [11, 12]
_TRUNK: Final = [*_SHOULDERS, *_HIPS]
_TRUNK_ROOM: Final = 1.9  # half side over the largest reach of the trunk from the hips
_BODY_ROOM: Final = 1.2  # half side over the largest reach of any keypoint from the hips


class Square(NamedTuple):
    """A square in the image; it may reach outside, where the picture is black."""

    left: float  # [px]
    top: float  # [px]
    side: float  # [px]


def whole(width: int, height: int) -> Square:
    """Return the smallest centred square around the whole image (letterbox)."""
    side = float(max(width, height))
    return Square((width - side) / 2.0, (height - side) / 2.0, side)


def around(pose: Floats, width: int, height: int, min_score: float) -> Square:
    """Return the square in which to look for the person in the next frame.

    As in MoveNet's published use (TensorFlow Hub, "MoveNet: Ultra fast and accurate
    pose detection model"): centred on the hips, wide enough for the trunk 1.9 times
    and for every sure keypoint 1.2 times; the whole image while the trunk is unsure.

    Args:
        pose: (17, 3) COCO keypoints, x, y [px], score.
        width: of the image [px].
        height: of the image [px].
        min_score: keypoints with less do not count.
    """
    sure = pose[:, 2] >= min_score
    if not (sure[_HIPS].any() and sure[_SHOULDERS].any()):
        return whole(width, height)
    centre = pose[_HIPS, :2].mean(axis=0)
    reach = np.abs(pose[:, :2] - centre).max(axis=1)
    half = max(_TRUNK_ROOM * float(reach[_TRUNK].max()), _BODY_ROOM * float(reach[sure].max()))
    x, y = float(centre[0]), float(centre[1])
    half = min(half, max(x, width - x, y, height - y))
    if not 1.0 <= half <= max(width, height) / 2.0:
        return whole(width, height)
    return Square(x - half, y - half, 2.0 * half)


def cut(cv2: Any, image_rgb: Image, square: Square, pixels: int) -> Image:
    """Return the square as (pixels, pixels, 3), black outside the image; pixel centres map to pixel centres."""
    scale = pixels / square.side
    shift = 0.5 * scale - 0.5
    to_square = np.array([[scale, 0.0, shift - square.left * scale], [0.0, scale, shift - square.top * scale]])
    warped: Image = cv2.warpAffine(image_rgb, to_square, (pixels, pixels), flags=cv2.INTER_LINEAR)
    return warped
