"""What the pipeline needs from a pose estimator, and how one is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from bridge.config.perception import PerceptionConfig
from bridge.errors import SourceError
from bridge.messages import Floats
from bridge.plugin import parse_plugin
from perception.estimators.movenet import load_movenet
from perception.estimators.own import load_own_estimator
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


def load_estimator(name: str, config: PerceptionConfig, options: Mapping[str, str] | None = None) -> PoseEstimator:
    """Load the estimator called `name`, or the one that is found at `module:name` or `file.py:name`.

    Args:
        name: what the user wrote.
        config: where the files of the known estimators are.
        options: of the role, for an estimator of one's own.

    Raises:
        SourceError: there is none of that name, or its file is missing or not what it should be.
        ConfigError: one's own is not there.
        MissingExtraError: its packages are not installed.
    """
    if name == "movenet":
        return load_movenet(config.movenet)
    if name == "yolo":
        return load_yolo(config.yolo)
    if (plugin := parse_plugin(name)) is not None:
        return load_own_estimator(plugin, name, options or {})
    raise SourceError(
        f"estimator '{name}': expected one of {', '.join(ESTIMATORS)}, "
        "or code of your own as module:name or file.py:name"
    )
