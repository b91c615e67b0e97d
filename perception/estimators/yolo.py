"""YOLOv8-Pose as an ONNX file through ONNX Runtime.

The file is exported once by the user (`yolo export model=yolov8n-pose.pt
format=onnx`). Input (1, 3, H, W) RGB in 0..1; output (1, 56, A): for each of A
anchors the box centre, width and height [network px], the person's score, and 17
COCO keypoints as x, y [network px], visibility.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from bridge.config.perception import YoloConfig
from bridge.errors import SourceError
from bridge.messages import Floats
from perception.estimators.letterbox import letterbox
from perception.extras import load_extra, load_opencv
from perception.skeleton import COCO_INDEX
from perception.sources.frame import Image

_ROWS: Final = 4 + 1 + 17 * 3
_TYPES: Final = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
_MOST_PEOPLE: Final = 32


def load_yolo(config: YoloConfig) -> Yolo:
    """Load the network from `config.model`.

    Raises:
        SourceError: the file is missing, is not ONNX, or has another signature than YOLOv8-Pose.
        MissingExtraError: ONNX Runtime or OpenCV is not installed.
    """
    if not config.model:
        raise SourceError("perception.yolo.model is not set: path of a YOLOv8-Pose .onnx file")
    onnxruntime = load_extra("onnxruntime", "YOLOv8-Pose", "onnxruntime", "yolo")
    cv2 = load_opencv("YOLOv8-Pose", "yolo")
    if not Path(config.model).is_file():
        raise SourceError(f"perception.yolo.model: {config.model}: no such file")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4  # what goes wrong is raised; nothing is to be printed beside it
    try:
        session = onnxruntime.InferenceSession(config.model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's exceptions share no other base
        raise SourceError(f"perception.yolo.model: {config.model}: not an ONNX model that can be run") from error
    return Yolo(session, cv2, config)


class Yolo:
    """A `PoseEstimator` for any number of people."""

    def __init__(self, session: Any, cv2: Any, config: YoloConfig) -> None:
        """Take a loaded ONNX Runtime session.

        Raises:
            SourceError: its input or output is not that of YOLOv8-Pose.
        """
        self._session = session
        self._cv2 = cv2
        self._config = config
        inputs, outputs = session.get_inputs(), session.get_outputs()
        shape = list(inputs[0].shape) if len(inputs) == 1 else []
        if len(shape) != 4 or _fixed(shape[1]) not in (None, 3) or inputs[0].type not in _TYPES:
            said = ", ".join(f"{i.name} {i.type} {i.shape}" for i in inputs)
            raise self._unlike(f"input {said}, expected one float tensor (1, 3, H, W)")
        given = list(outputs[0].shape)
        if len(outputs) != 1 or len(given) not in (0, 3) or (given and _fixed(given[1]) not in (None, _ROWS)):
            said = ", ".join(f"{o.name} {o.shape}" for o in outputs)
            raise self._unlike(f"output {said}, expected one tensor (1, {_ROWS}, anchors)")
        self._input = inputs[0].name
        self._type = _TYPES[inputs[0].type]
        self._height = _fixed(shape[2]) or config.input_px
        self._width = _fixed(shape[3]) or config.input_px

    def estimate(self, image_rgb: Image) -> list[Floats]:
        """Return everybody in the image, surest first.

        Raises:
            SourceError: the network gives something else than it declared.
        """
        framed, mapping = letterbox(self._cv2, image_rgb, self._width, self._height)
        tensor = (framed.transpose(2, 0, 1)[None] / 255.0).astype(self._type)
        try:
            (raw,) = self._session.run(None, {self._input: np.ascontiguousarray(tensor)})
        except Exception as error:  # ONNX Runtime's exceptions share no other base
            raise self._unlike(f"does not run on an input of {tensor.shape}") from error
        if raw.ndim != 3 or raw.shape[:2] != (1, _ROWS):
            raise self._unlike(f"output {raw.shape}, expected (1, {_ROWS}, anchors)")
        poses = decode(raw[0].astype(np.float64), self._config.min_score, self._config.max_overlap)
        people = []
        for pose in poses:
            person = np.array(pose[COCO_INDEX])
            person[:, :2] = mapping.to_image(person[:, :2])
            person[:, 2] = np.clip(person[:, 2], 0.0, 1.0)
            people.append(person)
        return people

    def _unlike(self, what: str) -> SourceError:
        return SourceError(f"perception.yolo.model: {self._config.model}: {what}; is it a YOLOv8-Pose export?")


def decode(raw: Floats, min_score: float, max_overlap: float) -> list[Floats]:
    """Turn the network's anchors into people.

    Args:
        raw: (56, A) rows cx, cy, w, h, score, then 17 times x, y, visibility.
        min_score: anchors with less are nobody.
        max_overlap: intersection over union above which two boxes are one person.

    Returns:
        (17, 3) each, in network pixels, surest first.
    """
    score = raw[4]
    sure = np.flatnonzero((score >= min_score) & np.isfinite(raw).all(axis=0))
    order = sure[np.argsort(-score[sure], kind="stable")]
    half = raw[2:4, order] / 2.0
    boxes = np.concatenate([raw[:2, order] - half, raw[:2, order] + half]).T  # (n, 4) x0 y0 x1 y1
    return [raw[5:, order[k]].reshape(17, 3) for k in suppress(boxes, max_overlap)[:_MOST_PEOPLE]]


def suppress(boxes: Floats, max_overlap: float) -> list[int]:
    """Keep of boxes that overlap only the first (greedy non-maximum suppression).

    Args:
        boxes: (n, 4) x0, y0, x1, y1, surest first.
        max_overlap: intersection over union above which a box falls to a surer one.

    Returns:
        Indices of the boxes kept, in order.
    """
    area = np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0), axis=1)
    waiting = np.arange(len(boxes))
    kept = []
    while len(waiting):
        best, waiting = int(waiting[0]), waiting[1:]
        kept.append(best)
        low = np.maximum(boxes[best, :2], boxes[waiting, :2])
        high = np.minimum(boxes[best, 2:], boxes[waiting, 2:])
        shared = np.prod(np.maximum(high - low, 0.0), axis=1)
        union = area[best] + area[waiting] - shared
        waiting = waiting[~(shared > max_overlap * union)]
    return kept


def _fixed(dimension: object) -> int | None:
    """The size of a static dimension; None for a symbolic one."""
    return dimension if isinstance(dimension, int) and dimension > 0 else None
