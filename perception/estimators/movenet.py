"""MoveNet SinglePose through LiteRT: one person, a few milliseconds a frame on one core.

The network gives the 17 COCO keypoints as (y, x, score) in 0..1 of a square input.
It was published with a crop that follows the person, and needs it: a small person
in a letterboxed frame is found far less precisely.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bridge.config.perception import MovenetConfig
from bridge.errors import SourceError
from bridge.messages import Floats
from perception.estimators.crop import around, cut, whole
from perception.extras import load_extra, load_opencv
from perception.skeleton import COCO_INDEX
from perception.sources.frame import Image

_OUTPUT = (1, 1, 17, 3)
_INPUT_TYPES = (np.uint8, np.int32, np.float32)  # of the published variants: quantised, and the rest


def load_movenet(config: MovenetConfig) -> Movenet:
    """Load the network from `config.weights`.

    Raises:
        SourceError: the file is missing or is not a single-pose MoveNet.
        MissingExtraError: LiteRT or OpenCV is not installed.
    """
    if not config.weights:
        raise SourceError("perception.movenet.weights is not set: path of MoveNet's .tflite file")
    litert = load_extra("ai_edge_litert.interpreter", "MoveNet", "ai-edge-litert", "movenet")
    cv2 = load_opencv("MoveNet", "movenet")
    if not Path(config.weights).is_file():
        raise SourceError(f"perception.movenet.weights: {config.weights}: no such file")
    try:
        interpreter = litert.Interpreter(model_path=config.weights, num_threads=1)
        interpreter.allocate_tensors()
    except (ValueError, RuntimeError) as error:
        raise SourceError(f"perception.movenet.weights: {config.weights}: not a TensorFlow Lite model") from error
    return Movenet(interpreter, cv2, config)


class Movenet:
    """A `PoseEstimator` that remembers where the person was."""

    def __init__(self, interpreter: Any, cv2: Any, config: MovenetConfig) -> None:
        """Take a loaded LiteRT interpreter.

        Raises:
            SourceError: its input or output is not that of a single-pose MoveNet.
        """
        self._interpreter = interpreter
        self._cv2 = cv2
        self._config = config
        self._pose: Floats | None = None  # (17, 3) of the frame before, None if nobody was there
        inputs, outputs = interpreter.get_input_details(), interpreter.get_output_details()
        shape = tuple(int(n) for n in inputs[0]["shape"])
        given = tuple(int(n) for n in outputs[0]["shape"])
        side = shape[1] if len(shape) == 4 else 0
        if shape != (1, side, side, 3) or inputs[0]["dtype"] not in _INPUT_TYPES or given != _OUTPUT:
            raise SourceError(
                f"perception.movenet.weights: {config.weights}: input {shape} and output {given}, "
                f"expected (1, N, N, 3) and {_OUTPUT}"
            )
        self._side = side
        self._type = inputs[0]["dtype"]
        self._input, self._output = inputs[0]["index"], outputs[0]["index"]

    def estimate(self, image_rgb: Image) -> list[Floats]:
        """Return the person in the image, or nobody."""
        height, width = image_rgb.shape[:2]
        if self._pose is None:
            square = whole(width, height)
        else:
            square = around(self._pose, width, height, self._config.crop_min_score)
        patch = cut(self._cv2, image_rgb, square, self._side)
        self._interpreter.set_tensor(self._input, patch.astype(self._type)[None])
        self._interpreter.invoke()
        found = self._interpreter.get_tensor(self._output)[0, 0].astype(np.float64)  # (17, 3) y, x, score
        pose = np.stack(
            [square.left + found[:, 1] * square.side, square.top + found[:, 0] * square.side, found[:, 2]], axis=1
        )
        person: Floats = pose[COCO_INDEX]
        if not np.isfinite(pose).all() or person[:, 2].mean() < self._config.min_score:
            self._pose = None
            return []
        self._pose = pose
        return [person]
