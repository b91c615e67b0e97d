"""A folder of images, in the order of the numbers in their names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bridge.clock import NS
from bridge.errors import SourceError
from perception.extras import load_opencv
from perception.sources.picture import Crop, to_rgb
from perception.sources.playback import Still

_SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"}


def open_folder(folder: Path, crop: Crop | None, fps_hz: float) -> Iterator[Still]:
    """Give the images in `folder` one by one, `fps_hz` to the second.

    Raises:
        SourceError: no image in it; later, one that cannot be read.
        MissingExtraError: OpenCV is not installed.
    """
    paths = sorted((path for path in folder.iterdir() if path.suffix.lower() in _SUFFIXES), key=_order)
    if not paths:
        raise SourceError(f"{folder}: no image in this folder ({', '.join(sorted(_SUFFIXES))})")
    cv2 = load_opencv("reading images", "video")
    return _stills(cv2, paths, crop, fps_hz)


def _stills(cv2: Any, paths: list[Path], crop: Crop | None, fps_hz: float) -> Iterator[Still]:
    for number, path in enumerate(paths):
        bgr = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if bgr is None:
            raise SourceError(f"{path}: not an image that OpenCV can read")
        image = to_rgb(bgr, crop, str(path))
        yield Still(round(number * NS / fps_hz), image.shape[1], image.shape[0], image, ())


def _order(path: Path) -> list[tuple[int, str]]:
    """Sort key in which frame9 comes before frame10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
