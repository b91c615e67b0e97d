"""Video files, through OpenCV."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bridge.clock import NS
from bridge.errors import SourceError
from perception.extras import load_opencv
from perception.sources.picture import Crop, to_rgb
from perception.sources.playback import Still


def open_video(path: Path, crop: Crop | None, default_fps_hz: float) -> Iterator[Still]:
    """Open `path` and give its frames one by one.

    A frame's time is the one the file gives it; where that does not advance, its
    number over the frame rate.

    Raises:
        SourceError: no such file, or not a video OpenCV can read.
        MissingExtraError: OpenCV is not installed.
    """
    if not path.is_file():
        raise SourceError(f"{path}: no such video file")
    cv2 = load_opencv("reading video", "video")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise SourceError(f"{path}: not a video that OpenCV can open")
    fps_hz = float(capture.get(cv2.CAP_PROP_FPS))
    if not (math.isfinite(fps_hz) and fps_hz >= 1.0):
        fps_hz = default_fps_hz
    return _stills(cv2, capture, crop, fps_hz, str(path))


def _stills(cv2: Any, capture: Any, crop: Crop | None, fps_hz: float, name: str) -> Iterator[Still]:
    first_ms = math.nan
    before_ns = -1
    try:
        while True:
            read, bgr = capture.read()
            if not read:
                return
            file_ms = float(capture.get(cv2.CAP_PROP_POS_MSEC))
            first_ms = file_ms if math.isnan(first_ms) else first_ms
            offset_ns = round((file_ms - first_ms) * NS / 1e3)
            if offset_ns <= before_ns:
                offset_ns = before_ns + round(NS / fps_hz)
            before_ns = offset_ns
            image = to_rgb(bgr, crop, name)
            yield Still(offset_ns, image.shape[1], image.shape[0], image, ())
    finally:
        capture.release()
