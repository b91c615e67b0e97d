"""A pose estimator of one's own, named `module:name` or `file.py:name`: called with the options of the role."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from bridge.errors import SourceError, SurefootError
from bridge.messages import KEYPOINTS, Floats
from bridge.plugin import Plugin, load_plugin
from perception.sources.frame import Image

_PERSON: Final = (KEYPOINTS, 3)


class OwnEstimator:
    """Somebody else's `PoseEstimator`, held to what it promises."""

    def __init__(self, estimator: Any, spec: str) -> None:
        self._estimator = estimator
        self._spec = spec

    def estimate(self, image_rgb: Image) -> list[Floats]:
        """Return everybody in the image.

        Raises:
            SourceError: a person is no array (12, 3).
        """
        people = [np.array(person, dtype=np.float64) for person in self._estimator.estimate(image_rgb)]
        for person in people:
            if person.shape != _PERSON:
                raise SourceError(
                    f"estimator '{self._spec}': a person has shape {person.shape}, expected {_PERSON}: x, y, "
                    "confidence of perception.skeleton's twelve (of 17 COCO keypoints: pose[COCO_INDEX])"
                )
        return people


def load_own_estimator(plugin: Plugin, spec: str, options: Mapping[str, str]) -> OwnEstimator:
    """Make the estimator that `plugin` names.

    Raises:
        ConfigError: there is no such thing.
        SourceError: it fails, or has no `estimate`.
    """
    make = load_plugin(plugin, f"estimator '{spec}'")
    try:
        made = make(options)
    except SurefootError:
        raise
    except Exception as error:  # whatever its author did not foresee
        raise SourceError(f"estimator '{spec}' fails: {type(error).__name__}: {error}") from error
    if not callable(getattr(made, "estimate", None)):
        raise SourceError(f"estimator '{spec}' gives a {type(made).__name__}, which has no method estimate(image_rgb)")
    return OwnEstimator(made, spec)
