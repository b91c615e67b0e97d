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
        SourceError: not four integers, or without extent.
    """
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError as error:
        raise SourceError(f"crop '{text}': expected X,Y,WIDTH,HEIGHT in whole pixels") from error
    return check_crop((x, y, width, height))


def check_crop(crop: Crop) -> Crop:
    """Return `crop` if it can be a part of an image.

    Raises:
        SourceError: negative origin or no extent.
    """
    if crop[0] < 0 or crop[1] < 0 or crop[2] <= 0 or crop[3] <= 0:
        raise SourceError(f"crop {_said(crop)}: expected X, Y >= 0 and WIDTH, HEIGHT > 0")
    return crop


def to_rgb(bgr: Any, crop: Crop | None, name: str) -> Image:
    """Return the used part of OpenCV's BGR image (H, W, 3) as contiguous RGB.

    Raises:
        SourceError: the crop reaches outside the image.
    """
    height, width = bgr.shape[:2]
    x, y, used_width, used_height = crop or (0, 0, width, height)
    if x + used_width > width or y + used_height > height:
        raise SourceError(
            f"{name}: crop {_said((x, y, used_width, used_height))} reaches outside the {width}x{height} image"
        )
    return np.ascontiguousarray(bgr[y : y + used_height, x : x + used_width, ::-1])


def _said(crop: Crop) -> str:
    return ",".join(str(value) for value in crop)
