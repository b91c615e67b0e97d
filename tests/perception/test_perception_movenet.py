from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.config.perception import MovenetConfig
from bridge.errors import MissingExtraError, SourceError
from perception.estimators.crop import around, cut, whole
from perception.estimators.movenet import Movenet, load_movenet
from perception.extras import load_opencv
from perception.skeleton import COCO_INDEX
from perception.sources.video_file import open_video

Floats = NDArray[np.float64]
Body = Callable[..., Floats]


class FakeInterpreter:
    """A network that sees one white dot, and puts all keypoints there."""

    def __init__(self, score: float = 0.9, shape: tuple[int, ...] = (1, 192, 192, 3), outputs: int = 17) -> None:
        self.score, self.shape, self.outputs = score, shape, outputs
        self.input: Any = None

    def get_input_details(self) -> list[dict[str, Any]]:
        return [{"index": 0, "shape": np.array(self.shape), "dtype": np.uint8}]

    def get_output_details(self) -> list[dict[str, Any]]:
        return [{"index": 1, "shape": np.array([1, 1, self.outputs, 3])}]

    def set_tensor(self, index: int, tensor: Any) -> None:
        self.input = tensor

    def invoke(self) -> None:
        pass

    def get_tensor(self, index: int) -> Any:
        weight = self.input[0, :, :, 0].astype(float)
        y, x = (np.indices(weight.shape) * weight).sum(axis=(1, 2)) / max(weight.sum(), 1.0)
        answer = np.full((1, 1, 17, 3), self.score, dtype=np.float32)
        answer[..., 0], answer[..., 1] = (y + 0.5) / 192, (x + 0.5) / 192
        return answer


def coco(person: Floats) -> Floats:
    """The 12 keypoints as 17, with the face at the shoulders."""
    pose = np.tile(person[0], (17, 1))
    pose[COCO_INDEX] = person
    return pose


def test_the_first_look_is_at_the_whole_image() -> None:
    assert whole(320, 240) == (0.0, -40.0, 320.0)
    assert whole(240, 320) == (-40.0, 0.0, 320.0)


def test_the_crop_holds_the_whole_person_with_room(body: Body) -> None:
    for size, x, y in ((60.0, 160.0, 120.0), (150.0, 100.0, 130.0), (40.0, 20.0, 60.0)):
        pose = coco(body(x=x, y=y, size=size))
        square = around(pose, 320, 240, 0.2)
        low, high = np.array([square.left, square.top]), np.array([square.left, square.top]) + square.side
        visible = np.clip(pose[:, :2], 0, [320, 240])
        assert ((visible >= low) & (visible <= high)).all()
        assert square.side <= 320


def test_the_crop_is_the_whole_image_while_the_trunk_is_unsure(body: Body) -> None:
    pose = coco(body(size=60.0))
    pose[[11, 12], 2] = 0.1
    assert around(pose, 320, 240, 0.2) == whole(320, 240)


def test_cutting_and_mapping_back_is_exact_to_a_fraction_of_a_pixel() -> None:
    cv2 = load_opencv("the test", "movenet")
    movenet = Movenet(FakeInterpreter(), cv2, MovenetConfig())
    for x, y in ((160, 120), (40, 40), (300, 200), (10, 230)):
        image = np.zeros((240, 320, 3), dtype=np.uint8)
        cv2.circle(image, (x, y), 6, (255, 255, 255), -1)
        (person,) = movenet.estimate(image)
        # pixel (x, y) covers [x, x + 1): its centre lies half a pixel further
        assert person[:, :2] == pytest.approx(np.tile([x + 0.5, y + 0.5], (12, 1)), abs=0.3)
        assert person[:, 2] == pytest.approx(np.full(12, 0.9))


def test_outside_the_image_the_cut_is_black() -> None:
    cv2 = load_opencv("the test", "movenet")
    patch = cut(cv2, np.full((240, 320, 3), 200, dtype=np.uint8), whole(320, 240), 192)
    assert patch.shape == (192, 192, 3)
    assert (patch[:20] == 0).all()
    assert (patch[-20:] == 0).all()
    assert (patch[30:160] == 200).all()


def test_low_scores_are_nobody() -> None:
    cv2 = load_opencv("the test", "movenet")
    movenet = Movenet(FakeInterpreter(score=0.05), cv2, MovenetConfig())
    assert movenet.estimate(np.zeros((240, 320, 3), dtype=np.uint8)) == []


@pytest.mark.parametrize("wrong", [{"shape": (1, 192, 160, 3)}, {"shape": (1, 3)}, {"outputs": 6}])
def test_another_network_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(SourceError, match=r"expected \(1, N, N, 3\) and \(1, 1, 17, 3\)"):
        Movenet(FakeInterpreter(**wrong), None, MovenetConfig())


def test_missing_weights_and_wrong_files_are_said(tmp_path: Path) -> None:
    pytest.importorskip("ai_edge_litert")
    with pytest.raises(SourceError, match=r"perception.movenet.weights is not set"):
        load_movenet(MovenetConfig(weights=""))
    with pytest.raises(SourceError, match=r"perception.movenet.weights: .*none.tflite: no such file"):
        load_movenet(MovenetConfig(weights=str(tmp_path / "none.tflite")))
    wrong = tmp_path / "wrong.tflite"
    wrong.write_bytes(b"not a network" * 100)
    with pytest.raises(SourceError, match="not a TensorFlow Lite model"):
        load_movenet(MovenetConfig(weights=str(wrong)))


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ai_edge_litert.interpreter", None)
    with pytest.raises(MissingExtraError, match=r"MoveNet needs .* pip install 'surefoot\[movenet\]'"):
        load_movenet(MovenetConfig(weights="movenet.tflite"))


@pytest.mark.data
@pytest.mark.parametrize("name", ["fall-16", "fall-21", "fall-22"])
def test_keypoints_agree_with_the_reference_on_urfd(data_dir: Path, name: str) -> None:
    pytest.importorskip("ai_edge_litert")
    movenet = load_movenet(MovenetConfig(weights=str(data_dir / "weights" / "movenet_lightning_int8.tflite")))
    video = data_dir / "urfd" / "videos" / f"{name}-cam0.mp4"
    found = []
    for still in open_video(video, (320, 0, 320, 240), 30.0):
        assert still.image is not None
        people = movenet.estimate(still.image)
        found.append(people[0] if people else np.full((12, 3), np.nan))
    with np.load(data_dir / "urfd" / "falls.npz") as falls:
        reference, label = falls[f"{name}/movenet"], falls[f"{name}/label"]
    assert len(found) == len(reference)
    distance = np.linalg.norm(np.array(found)[label < 1, :, :2] - reference[label < 1, :, :2], axis=-1)
    assert np.median(distance[~np.isnan(distance)]) < 5.0
    assert np.isnan(distance).mean() < 0.02
