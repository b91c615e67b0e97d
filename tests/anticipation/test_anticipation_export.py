"""The ONNX graph says what the live predictor says."""

import dataclasses
import json

import numpy as np
import pytest
from anticipation_nets import message, random_checkpoint

from anticipation import checkpoint as checkpoints
from anticipation import export as exporting
from anticipation.motion import ROWS, WINDOW, DctMlpForecaster, LstmForecaster
from anticipation.predictor import Predictor
from bridge.cli import main
from bridge.config.anticipation import AnticipationConfig
from bridge.errors import MissingExtraError, SurefootError
from bridge.messages import CLASSES
from perception.skeleton import NAMES

onnxruntime = pytest.importorskip("onnxruntime")


@pytest.fixture(scope="module")
def deployed(tmp_path_factory):
    """The shipped weights, exported by the command."""
    folder = tmp_path_factory.mktemp("deploy")
    assert not main(["export", "--out", str(folder / "new")])
    return folder / "new"


def session(folder):
    return onnxruntime.InferenceSession(str(folder / "surefoot.onnx"), providers=["CPUExecutionProvider"])


def test_the_graph_agrees_with_the_running_predictor(deployed):
    """Not only with the module it was traced from: with what `surefoot up` publishes of the same keypoints."""
    predictor = Predictor(checkpoints.load(), AnticipationConfig())
    rng = np.random.default_rng(0)
    graph = session(deployed)
    lean = np.zeros((12, 2))
    for tick in range(40):
        lean[:, 0] = 0.002 * tick * np.arange(12)
        standing = message(0).position_px / 100 - (1.6, 1.2)
        predictor.push(message(tick, standing + lean + rng.normal(0, 0.01, (12, 2))))
        horizon = predictor.predict()
        if horizon is None:
            continue
        window = predictor._window.rows[None].astype(np.float32)
        probabilities, foreseen = graph.run(["probabilities", "forecast"], {"window": window})
        assert horizon.valid, horizon.reason
        assert horizon.quality > 0.5  # below, 'stable' is held back
        assert np.abs(probabilities[0] - horizon.probabilities).max() < 1e-4
        assert foreseen.shape == (1, 15, ROWS, 2)
    assert horizon is not None


def test_any_number_of_windows_at_once_gives_what_each_gives_alone(deployed):
    graph = session(deployed)
    windows = exporting.trial_windows(checkpoints.load())
    together = graph.run(None, {"window": windows})[0]
    alone = np.concatenate([graph.run(None, {"window": window[None]})[0] for window in windows[:8]])
    assert np.abs(together[:8] - alone).max() < 1e-5
    assert np.allclose(together.sum(axis=-1), 1, atol=1e-5)


def test_the_description_names_what_the_graph_has(deployed):
    about = json.loads((deployed / "surefoot.json").read_text())
    graph = session(deployed)
    assert [value.name for value in graph.get_inputs()] == list(about["inputs"])
    assert [value.name for value in graph.get_outputs()] == list(about["outputs"])
    for value in (*graph.get_inputs(), *graph.get_outputs()):
        said = (about["inputs"] | about["outputs"])[value.name]
        assert value.shape[1:] == said["shape"][1:]
    assert about["inputs"]["window"]["rows"][:12] == list(NAMES)
    assert len(about["inputs"]["window"]["rows"]) == ROWS
    assert about["outputs"]["probabilities"]["classes"] == list(CLASSES)
    assert "non-commercial" in about["licence"]
    assert max(about["largest_difference_to_pytorch"].values()) < 1e-4


@pytest.mark.parametrize("kind", [LstmForecaster(hidden=8, layers=1), DctMlpForecaster(16, 1), "zero_velocity"])
def test_other_forecasters_are_exported_too(tmp_path, kind):
    forecaster = kind if isinstance(kind, str) else kind.eval()
    made = exporting.export(dataclasses.replace(random_checkpoint(), forecaster=forecaster), tmp_path, "made")
    assert max(made.differences.values()) < 1e-4
    assert {path.name for path in tmp_path.iterdir()} == {"surefoot.onnx", "surefoot.json"}


def test_a_graph_that_disagrees_is_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(exporting, "compare", lambda *_: {"probabilities": 0.0, "forecast": float("nan")})
    with pytest.raises(SurefootError, match="differs from PyTorch by nan"):
        exporting.export(random_checkpoint(), tmp_path, "made")
    assert not list(tmp_path.iterdir())


def test_a_difference_is_seen(deployed):
    judge = exporting.Judge(random_checkpoint()).eval()  # not the networks of that graph
    windows = np.zeros((3, WINDOW, ROWS, 2), dtype=np.float32)
    assert exporting.compare(deployed / "surefoot.onnx", judge, windows)["probabilities"] > 1e-3


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(exporting.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"surefoot\[export\]"):
        exporting.export(random_checkpoint(), tmp_path, "made")


def test_a_folder_that_cannot_be_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["export", "--out", str(tmp_path / "file" / "deploy")]) == 2
    assert "cannot write" in capsys.readouterr().err
