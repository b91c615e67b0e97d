"""Frames as OpenCV gives them, made into the part of the image that is used."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from bridge.errors import SourceError
from perception.sources.frame import Image

Crop: TypeAlias = tuple[int, int, int, int]


def parse_crop(text: str) -> Crop:
    """Read `x,y,width,height` [px].

    Raises:
        SourceError: not four integers, a negative origin, or no extent.
    """
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError as error:
        raise SourceError(f"crop '{text}': expected X,Y,WIDTH,HEIGHT in whole pixels") from error
    if x < 0 or y < 0 or width <= 0 or height <= 0:
        raise SourceError(f"crop '{text}': expected X, Y >= 0 and WIDTH, HEIGHT > 0")
    return x, y, width, height


def to_rgb(bgr: Any, crop: Crop | None, name: str) -> Image:
    """Return the used part of OpenCV's BGR image (H, W, 3) as contiguous RGB.

    Raises:
        SourceError: the crop reaches outside the image.
    """
    height, width = bgr.shape[:2]
    x, y, used_width, used_height = crop or (0, 0, width, height)
    if x + used_width > width or y + used_height > height:
        said = f"{x},{y},{used_width},{used_height}"
        raise SourceError(f"{name}: crop {said} reaches outside the {width}x{height} image")
    return np.ascontiguousarray(bgr[y : y + used_height, x : x + used_width, ::-1])
