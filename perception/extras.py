"""Optional packages, loaded when first needed and missed by name."""

from __future__ import annotations

import importlib
import os
from typing import Any

from bridge.errors import MissingExtraError


def load_extra(module: str, what: str, package: str, extra: str) -> Any:
    """Return the imported `module`.

    Raises:
        MissingExtraError: `package` is not installed; says that `what` needs it and which extra brings it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(what, package, extra) from error


def load_opencv(what: str, extra: str) -> Any:
    """Return `cv2`: silent, because what goes wrong is raised; on one thread, because the networks want the cores."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read once, when FFmpeg is first used
    cv2 = load_extra("cv2", what, "opencv-python-headless", extra)
    cv2.setNumThreads(1)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    return cv2
