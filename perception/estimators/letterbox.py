"""Fitting an image into a network's input without changing its proportions."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from bridge.messages import Floats
from perception.sources.frame import Image

_GREY = 114  # the border YOLO networks are trained with


class Letterbox(NamedTuple):
    """Scale and border: network pixel = image pixel * scale + border.

    The two scales differ by the rounding of the scaled image to whole pixels.
    """

    scale_x: float
    scale_y: float
    left: int  # [network px]
    top: int  # [network px]

    def to_image(self, xy: Floats) -> Floats:
        """Map points (..., 2) from the network's pixels to the image's."""
        image_xy: Floats = (xy - np.array([self.left, self.top])) / np.array([self.scale_x, self.scale_y])
        return image_xy


def letterbox(cv2: Any, image_rgb: Image, width: int, height: int) -> tuple[Image, Letterbox]:
    """Return the image scaled into (height, width, 3), centred between grey borders, and the mapping."""
    image_height, image_width = image_rgb.shape[:2]
    scale = min(width / image_width, height / image_height)
    used_width, used_height = max(1, round(image_width * scale)), max(1, round(image_height * scale))
    left, top = (width - used_width) // 2, (height - used_height) // 2
    framed = np.full((height, width, 3), _GREY, dtype=np.uint8)
    resized = cv2.resize(image_rgb, (used_width, used_height), interpolation=cv2.INTER_LINEAR)
    framed[top : top + used_height, left : left + used_width] = resized
    return framed, Letterbox(used_width / image_width, used_height / image_height, left, top)
