"""What the pipeline needs from a pose estimator, and how one is chosen."""

from __future__ import annotations

from typing import Protocol

from bridge.config.perception import PerceptionConfig
from bridge.errors import SourceError
from bridge.messages import Floats
from perception.estimators.movenet import load_movenet
from perception.estimators.yolo import load_yolo
from perception.sources.frame import Image

ESTIMATORS = ("movenet", "yolo")


class PoseEstimator(Protocol):
    """Finds people in an image."""

    def estimate(self, image_rgb: Image) -> list[Floats]:
        """Return one (12, 3) array for each person: x, y [px], confidence 0..1; surest first.

        Args:
            image_rgb: (H, W, 3).
        """
        ...


def load_estimator(name: str, config: PerceptionConfig) -> PoseEstimator:
    """Load the estimator called `name`.

    Raises:
        SourceError: there is none of that name, or its file is missing or not what it should be.
        MissingExtraError: its packages are not installed.
    """
    if name == "movenet":
        return load_movenet(config.movenet)
    if name == "yolo":
        return load_yolo(config.yolo)
    raise SourceError(f"estimator '{name}': expected one of {', '.join(ESTIMATORS)}")
