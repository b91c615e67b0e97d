"""YOLOv8-Pose on small ONNX graphs with its signature, made here."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.config.perception import YoloConfig
from bridge.errors import MissingExtraError, SourceError
from perception.estimators.letterbox import letterbox
from perception.estimators.yolo import decode, load_yolo, suppress
from perception.extras import load_opencv
from perception.skeleton import COCO_INDEX

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402 (after the check that it is there)

Floats = NDArray[np.float64]
X_ROWS, Y_ROWS = [0, 2, *range(5, 56, 3)], [1, 3, *range(6, 56, 3)]


def column(cx: float, cy: float, w: float, h: float, score: float) -> Floats:
    """One anchor (56,): a box in shares of the input, its keypoints on a grid inside it."""
    rows = np.zeros(56)
    rows[:5] = cx, cy, w, h, score
    rows[5::3] = cx + w * (np.arange(17) / 16 - 0.5)
    rows[6::3] = cy + h * (np.arange(17) % 5 / 4 - 0.5)
    rows[7::3] = 0.8
    return rows


def save(path: Path, nodes: list[Any], constants: dict[str, Any], inputs: list[Any], output: Any) -> YoloConfig:
    initializers = [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "pose", inputs, [output], initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return YoloConfig(model=str(path))


def tensor(name: str, shape: list[int | str], kind: int = TensorProto.FLOAT) -> Any:
    return helper.make_tensor_value_info(name, kind, shape)


def anchors_graph(path: Path, anchors: Floats, shape: list[int | str], **changes: Any) -> YoloConfig:
    """A network that answers with fixed anchors (56, A), given in shares of whatever input size it gets."""
    horizontal, vertical, plain = (np.zeros((1, 56, 1), dtype=np.float32) for _ in range(3))
    horizontal[0, X_ROWS], vertical[0, Y_ROWS] = 1, 1
    plain[0] = 1 - horizontal[0] - vertical[0]
    nodes = [
        helper.make_node("Shape", ["images"], ["shape"]),
        helper.make_node("Cast", ["shape"], ["sizes"], to=TensorProto.FLOAT),
        helper.make_node("Gather", ["sizes", "three"], ["w"]),
        helper.make_node("Gather", ["sizes", "two"], ["h"]),
        helper.make_node("Mul", ["horizontal", "w"], ["hw"]),
        helper.make_node("Mul", ["vertical", "h"], ["vh"]),
        helper.make_node("Sum", ["hw", "vh", "plain"], ["units"]),
        helper.make_node("Mul", ["anchors", "units"], ["output0"]),
    ]
    constants = {
        "anchors": anchors.astype(np.float32)[None],
        "horizontal": horizontal,
        "vertical": vertical,
        "plain": plain,
        "three": np.array(3),
        "two": np.array(2),
    }
    output = tensor("output0", changes.get("output", [1, 56, anchors.shape[1]]))
    return save(path, nodes, constants, [tensor("images", shape)], output)


def dot_graph(path: Path, size: int) -> YoloConfig:
    """A network that finds the brightest pixel and puts one person with all keypoints there."""
    mask_x, mask_y, rest = (np.zeros((1, 56, 1), dtype=np.float32) for _ in range(3))
    mask_x[0, [0, *range(5, 56, 3)]], mask_y[0, [1, *range(6, 56, 3)]] = 1, 1
    rest[0, [2, 3]], rest[0, 4], rest[0, 7::3] = 10, 0.9, 0.7
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["grey"], axes=[1], keepdims=0),
        helper.make_node("ReduceMax", ["grey"], ["columns"], axes=[1], keepdims=0),
        helper.make_node("ReduceMax", ["grey"], ["rows"], axes=[2], keepdims=0),
        helper.make_node("ArgMax", ["columns"], ["xi"], axis=1, keepdims=0),
        helper.make_node("ArgMax", ["rows"], ["yi"], axis=1, keepdims=0),
        helper.make_node("Cast", ["xi"], ["x"], to=TensorProto.FLOAT),
        helper.make_node("Cast", ["yi"], ["y"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["mask_x", "x"], ["at_x"]),
        helper.make_node("Mul", ["mask_y", "y"], ["at_y"]),
        helper.make_node("Sum", ["at_x", "at_y", "rest"], ["output0"]),
    ]
    constants = {"mask_x": mask_x, "mask_y": mask_y, "rest": rest}
    return save(path, nodes, constants, [tensor("images", [1, 3, size, size])], tensor("output0", [1, 56, 1]))


def image(width: int, height: int) -> Any:
    return np.zeros((height, width, 3), dtype=np.uint8)


@pytest.mark.parametrize("shape", [[1, 3, 64, 64], [1, 3, 96, 64], ["batch", 3, "height", "width"]])
@pytest.mark.parametrize("size", [(320, 240), (240, 320), (64, 64)])
def test_people_come_back_in_image_pixels(tmp_path: Path, shape: list[int | str], size: tuple[int, int]) -> None:
    anchors = np.stack([column(0.5, 0.5, 0.2, 0.3, 0.9), column(0.5, 0.5, 0.2, 0.3, 0.1)], axis=1)
    config = anchors_graph(tmp_path / "pose.onnx", anchors, shape).model_copy(update={"input_px": 128})
    (person,) = load_yolo(config).estimate(image(*size))
    width, height = size
    net_h, net_w = (int(n) if isinstance(n, int) else 128 for n in shape[2:])
    scale = min(net_w / width, net_h / height)
    expected = np.column_stack([anchors[5::3, 0] - 0.5, anchors[6::3, 0] - 0.5])[COCO_INDEX]
    expected = expected * [net_w, net_h] / scale + [width / 2, height / 2]
    assert person.shape == (12, 3)
    assert person[:, :2] == pytest.approx(expected, abs=0.75 / scale)  # the border is whole network pixels
    assert (np.abs(person[:, 2] - 0.8) < 1e-6).all()


@pytest.mark.parametrize("size", [(320, 240), (200, 600), (64, 48)])
def test_a_thing_in_the_picture_is_found_where_it_is(tmp_path: Path, size: tuple[int, int]) -> None:
    yolo = load_yolo(dot_graph(tmp_path / "dot.onnx", 160))
    width, height = size
    for x, y in ((width // 4, height // 3), (width - 8, 5), (width // 2, height - 6)):
        picture = image(width, height)
        picture[y - 4 : y + 5, x - 4 : x + 5] = 255
        (person,) = yolo.estimate(picture)
        step = max(width, height) / 160
        assert np.abs(person[:, :2] - [x, y]).max() <= 4 + 1.5 * step


def test_letterboxing_keeps_proportions_and_maps_back() -> None:
    cv2 = load_opencv("the test", "yolo")
    framed, mapping = letterbox(cv2, np.full((240, 320, 3), 255, dtype=np.uint8), 64, 64)
    white = np.argwhere(framed[:, :, 0] == 255)
    assert framed.shape == (64, 64, 3)
    assert (white.min(axis=0).tolist(), white.max(axis=0).tolist()) == ([8, 0], [55, 63])
    assert set(np.unique(framed).tolist()) == {114, 255}
    assert mapping.to_image(np.array([[0.0, 8.0], [64.0, 56.0]])) == pytest.approx(np.array([[0, 0], [320, 240]]))


def test_overlapping_boxes_are_one_person_and_the_surest_comes_first() -> None:
    anchors = [
        column(0.30, 0.5, 0.2, 0.4, 0.6),
        column(0.31, 0.5, 0.2, 0.4, 0.9),  # the same person, surer
        column(0.75, 0.5, 0.2, 0.4, 0.7),
        column(0.10, 0.1, 0.1, 0.1, 0.2),  # too unsure
        column(0.50, 0.5, 0.2, np.nan, 0.95),  # not finite: never a person
    ]
    poses = decode(np.stack(anchors, axis=1), 0.25, 0.7)
    assert [pose[:, 0].mean() for pose in poses] == pytest.approx([0.31, 0.75])
    assert decode(np.zeros((56, 0)), 0.25, 0.7) == []


def test_suppression_follows_the_definition() -> None:
    rng = np.random.default_rng(0)
    low = rng.uniform(0, 80, (60, 2))
    boxes = np.concatenate([low, low + rng.uniform(5, 40, (60, 2))], axis=1)

    def overlap(a: Floats, b: Floats) -> float:
        shared = np.prod(np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0))
        return float(shared / (np.prod(a[2:] - a[:2]) + np.prod(b[2:] - b[:2]) - shared))

    kept = suppress(boxes, 0.3)
    for k in range(60):
        falls = any(overlap(boxes[k], boxes[j]) > 0.3 for j in kept if j < k)
        assert (k in kept) != falls
    assert suppress(np.zeros((2, 4)), 0.5) == [0, 1]  # without area nothing overlaps


def _two_inputs(path: Path) -> YoloConfig:
    node = helper.make_node("Add", ["images", "other"], ["output0"])
    shape: list[int | str] = [1, 3, 64, 64]
    return save(path, [node], {}, [tensor("images", shape), tensor("other", shape)], tensor("output0", shape))


def _integers(path: Path) -> YoloConfig:
    node = helper.make_node("Identity", ["images"], ["output0"])
    shape: list[int | str] = [1, 3, 64, 64]
    kind = TensorProto.UINT8
    return save(path, [node], {}, [tensor("images", shape, kind)], tensor("output0", shape, kind))


def _detector(path: Path) -> YoloConfig:
    node = helper.make_node("Identity", ["boxes"], ["output0"])
    boxes = {"boxes": np.zeros((1, 84, 10), dtype=np.float32)}
    return save(path, [node], boxes, [tensor("images", [1, 3, 64, 64])], tensor("output0", [1, 84, 10]))


@pytest.mark.parametrize(
    ("graph", "message"),
    [
        (_two_inputs, r"expected one float tensor \(1, 3, H, W\)"),
        (_integers, r"input images tensor\(uint8\)"),
        (_detector, r"output output0 \[1, 84, 10\], expected one tensor \(1, 56, anchors\)"),
    ],
)
def test_another_signature_is_refused_when_loaded(
    tmp_path: Path, graph: Callable[[Path], YoloConfig], message: str
) -> None:
    with pytest.raises(SourceError, match=message + ".*is it a YOLOv8-Pose export"):
        load_yolo(graph(tmp_path / "other.onnx"))


def test_an_output_unlike_the_declared_one_is_said(tmp_path: Path) -> None:
    node = helper.make_node("Reshape", ["images", "shape"], ["output0"])
    shape = {"shape": np.array([1, -1, 8])}
    images = tensor("images", [1, 3, "height", "width"])
    config = save(tmp_path / "vague.onnx", [node], shape, [images], tensor("output0", [1, "rows", 8]))
    with pytest.raises(SourceError, match=r"output \(1, 1536, 8\), expected \(1, 56, anchors\)"):
        load_yolo(config.model_copy(update={"input_px": 64})).estimate(image(64, 64))


def test_missing_and_wrong_files_are_said(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"perception.yolo.model is not set"):
        load_yolo(YoloConfig())
    with pytest.raises(SourceError, match=r"none.onnx: no such file"):
        load_yolo(YoloConfig(model=str(tmp_path / "none.onnx")))
    wrong = tmp_path / "wrong.onnx"
    wrong.write_bytes(b"not a network")
    with pytest.raises(SourceError, match=r"wrong.onnx: not an ONNX model"):
        load_yolo(YoloConfig(model=str(wrong)))


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(MissingExtraError, match=r"YOLOv8-Pose needs .* pip install 'surefoot\[yolo\]'"):
        load_yolo(YoloConfig(model="pose.onnx"))
