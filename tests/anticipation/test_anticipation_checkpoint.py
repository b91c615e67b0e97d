"""A checkpoint is whole or refused, and says why."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from anticipation_nets import random_checkpoint
from safetensors.torch import save_file

from anticipation.checkpoint import Checkpoint, load, save
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import DctMlpForecaster, LstmForecaster, MlpForecaster
from bridge.errors import CheckpointError


@pytest.fixture
def checkpoint() -> Checkpoint:
    return random_checkpoint()


@pytest.fixture
def path(checkpoint: Checkpoint, tmp_path: Path) -> Path:
    save(checkpoint, tmp_path / "a.safetensors")
    return tmp_path / "a.safetensors"


def with_header(path: Path, **changes: object) -> Path:
    """Rewrite the JSON entry of a checkpoint's header, leaving its arrays as they are."""
    raw = path.read_bytes()
    (length,) = struct.unpack("<Q", raw[:8])
    header = json.loads(raw[8 : 8 + length])
    entry = json.loads(header["__metadata__"]["surefoot"]) | changes
    header["__metadata__"]["surefoot"] = json.dumps(entry)
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + raw[8 + length :])
    return path


def refusal(path: Path) -> str:
    with pytest.raises(CheckpointError) as caught:
        load(path)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


@pytest.mark.parametrize(
    "forecaster",
    [
        MlpForecaster(32, 2),
        DctMlpForecaster(32, 2),
        LstmForecaster("rollout", 32),
        LstmForecaster("direct", 32),
        "zero_velocity",
    ],
)
def test_everything_comes_back(forecaster, tmp_path):
    saved = replace(random_checkpoint(), forecaster=forecaster)
    save(saved, tmp_path / "deeper" / "b.safetensors", storage="float32")
    loaded = load(tmp_path / "deeper" / "b.safetensors")
    frames = torch.randn(1, 30, 13, 2)
    for network in (saved.forecaster, saved.classifier):
        if isinstance(network, torch.nn.Module):
            network.eval()
    assert torch.equal(loaded.classifier(frames), saved.classifier(frames))
    assert torch.equal(loaded.logits(frames[:, :15]), saved.logits(frames[:, :15]))
    assert torch.equal(loaded.forecast(frames[:, :15]), saved.forecast(frames[:, :15]))
    for name, array in saved.plane.arrays().items():
        assert np.array_equal(loaded.plane.arrays()[name], array)
    for name, array in saved.statistics.arrays().items():
        assert np.array_equal(loaded.statistics.arrays()[name], array)
    assert np.array_equal(loaded.temperature, saved.temperature)
    assert loaded.provenance == saved.provenance
    assert loaded.plane.features == saved.plane.features


def test_half_precision_halves_the_file_and_hardly_moves_the_answer(checkpoint, path, tmp_path):
    save(checkpoint, tmp_path / "wide.safetensors", storage="float32")
    assert path.stat().st_size < 0.6 * (tmp_path / "wide.safetensors").stat().st_size
    frames = torch.randn(4, 15, 13, 2)
    checkpoint.classifier.eval()
    torch.testing.assert_close(load(path).classifier(frames), checkpoint.classifier(frames), atol=5e-3, rtol=0)


def test_loaded_networks_do_not_train(path):
    loaded = load(path)
    assert not loaded.classifier.training
    assert not any(parameter.requires_grad for parameter in loaded.classifier.parameters())


def test_missing(tmp_path):
    assert "no such checkpoint" in refusal(tmp_path / "nothing.safetensors")


@pytest.mark.parametrize("keep", [0, 4, 200, -1])
def test_truncated(path, keep):
    path.write_bytes(path.read_bytes()[:keep])
    assert "not a whole safetensors file" in refusal(path)


def test_another_kind_of_file(path):
    torch.save({"weights": torch.zeros(3)}, path)
    assert "not a whole safetensors file" in refusal(path)


def test_safetensors_of_someone_else(path):
    save_file({"weights": torch.zeros(3)}, path)
    assert "not a checkpoint of Surefoot" in refusal(path)


def test_another_version(path):
    assert "format is 99, this Surefoot reads up to 2: upgrade Surefoot" in refusal(with_header(path, format=99))


def test_weights_from_before_the_centre_s_velocity_say_how_to_get_new_ones(path):
    assert "make it again with `surefoot train`" in refusal(with_header(path, format=1))


def test_without_outlook_and_mirror(checkpoint, tmp_path):
    """The paper's configuration has neither."""
    bare = replace(checkpoint, outlook=None, mirrored=False)
    save(bare, tmp_path / "bare.safetensors", storage="float32")
    loaded = load(tmp_path / "bare.safetensors")
    assert loaded.outlook is None
    assert not loaded.mirrored
    window = torch.randn(2, 15, 13, 2)
    frames = torch.cat((window, loaded.forecast(window)), dim=1)
    assert torch.equal(loaded.logits(window), loaded.classifier(frames))


@pytest.mark.parametrize("entry", ["classes", "keypoints"])
def test_another_order(path, entry):
    assert entry in refusal(with_header(path, **{entry: ["fall", "stable", "transient"]}))


def test_another_window(path):
    assert "window" in refusal(with_header(path, window=30))


def test_unknown_network(path):
    assert "'transformer'" in refusal(with_header(path, forecaster={"name": "transformer", "settings": {}}))


def test_unknown_setting(path):
    settings = {"name": "mlp", "settings": {"depth": 3}}
    assert "depth" in refusal(with_header(path, forecaster=settings))


def test_missing_entry(path):
    assert "settings" in refusal(with_header(path, classifier={"name": "dgnn"}))


def test_shapes_that_do_not_fit(path):
    wide = DirectedGraphNetwork(widths=(16, 32, 128)).settings
    assert "size mismatch" in refusal(with_header(path, classifier={"name": "dgnn", "settings": wide}))


def test_a_plane_that_does_not_fit(path):
    assert "plane features" in refusal(with_header(path, plane={"features": "spectrum"}))


def test_weights_that_are_not_finite(checkpoint, tmp_path):
    with torch.no_grad():
        checkpoint.classifier.get_parameter("head.weight")[0, 0] = torch.nan
    save(checkpoint, tmp_path / "nan.safetensors")
    assert "'classifier/head.weight' is not finite" in refusal(tmp_path / "nan.safetensors")


def test_a_failed_save_leaves_the_old_file(checkpoint, path, monkeypatch):
    before = path.read_bytes()

    def full_disk(_: int) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="no space left"):
        save(checkpoint, path, storage="float32")
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_temperature_must_be_positive():
    with pytest.raises(ValueError, match="temperature"):
        replace(random_checkpoint(), temperature=np.zeros(16))
