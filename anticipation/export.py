"""The networks as one ONNX graph, for those who deploy without PyTorch: window in, probabilities and motion out.

Inside are the forecaster, the classifier, the average with the mirrored motion and the temperatures: everything between
a window of relative coordinates and calibrated probabilities. Outside stay the cleaning and the window before it, and
the quality and the transient plane after it, which need no PyTorch (`perception.cleaning`, `anticipation.quality`,
`anticipation.transient`).
"""

from __future__ import annotations

import importlib.util
import json
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from anticipation.checkpoint import Checkpoint, write_whole
from anticipation.motion import HORIZON, ROWS, WINDOW
from bridge.errors import MissingExtraError, SurefootError
from bridge.messages import CLASSES, STEP_S, STEPS
from perception.skeleton import NAMES

TOLERANCE: Final = 1e-4  # largest difference between ONNX and PyTorch that is accepted
OPSET: Final = 17
WINDOW_NAME: Final = "window"
PROBABILITIES: Final = "probabilities"
FORECAST: Final = "forecast"
GRAPH_FILE: Final = "surefoot.onnx"
ABOUT_FILE: Final = "surefoot.json"
_PACKAGES: Final = ("onnx", "onnxruntime")
_BATCHES: Final = (1, 3, 16)  # sizes that the written graph is tried with


class Exported(NamedTuple):
    """What was written, and how well it agrees."""

    graph: Path
    about: Path
    differences: dict[str, float]  # largest difference to PyTorch, for each output
    windows: int  # that were compared


class Judge(nn.Module):
    """Windows (B, 15, ROWS, 2) -> calibrated probabilities (B, 16, 3) and the foreseen frames (B, 15, ROWS, 2)."""

    temperature: Tensor

    def __init__(self, checkpoint: Checkpoint) -> None:
        super().__init__()
        self._checkpoint = checkpoint
        self.parts = nn.ModuleList(part for part in vars(checkpoint).values() if isinstance(part, nn.Module))
        self.register_buffer("temperature", torch.tensor(checkpoint.temperature, dtype=torch.float32)[:, None])

    def forward(self, window: Tensor) -> tuple[Tensor, Tensor]:
        """Judge the windows."""
        probabilities = torch.softmax(self._checkpoint.logits(window) / self.temperature, dim=-1)
        return probabilities, self._checkpoint.forecast(window)


def export(checkpoint: Checkpoint, folder: Path, origin: str) -> Exported:
    """Write the graph and a description of it, read it back and compare it with PyTorch.

    Args:
        checkpoint: what to export.
        folder: where to; it is made.
        origin: where the checkpoint is from, for the description.

    Raises:
        MissingExtraError: a package of the extra `export` is not installed.
        SurefootError: the folder cannot be written, or the graph does not say what PyTorch says; then nothing is left.
    """
    for package in _PACKAGES:
        if importlib.util.find_spec(package) is None:
            raise MissingExtraError("the export to ONNX", package, "export")
    judge = Judge(checkpoint).eval().requires_grad_(False)
    graph, about = folder / GRAPH_FILE, folder / ABOUT_FILE
    try:
        write_whole(graph, _graph(judge))
        windows = trial_windows(checkpoint)
        differences = compare(graph, judge, windows)
        for name, worst in differences.items():
            if not worst <= TOLERANCE:  # nor NaN
                graph.unlink()
                raise SurefootError(
                    f"{graph}: {name} differs from PyTorch by {worst:.1e}, limit {TOLERANCE:.0e}; not kept"
                )
        write_whole(about, (json.dumps(_describe(checkpoint, origin, differences), indent=1) + "\n").encode())
    except OSError as error:
        raise SurefootError(f"cannot write to '{folder}': {error.strerror}") from error
    return Exported(graph, about, differences, len(windows))


def trial_windows(checkpoint: Checkpoint, seed: int = 0) -> NDArray[np.float32]:
    """Make windows to try a graph with, (M, 15, ROWS, 2): people who stand, sway, fall over and lie, and noise."""
    rng = np.random.default_rng(seed)
    pose = np.zeros((ROWS, 2))
    pose[: len(NAMES)] = checkpoint.statistics.mean_pose
    turns = rng.uniform(-np.pi / 2, np.pi / 2, size=(48, 2))  # at the window's beginning and end [rad]
    angle = np.linspace(turns[:, 0], turns[:, 1], WINDOW, axis=1)  # (48, 15)
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=-1).reshape(48, WINDOW, 2, 2)
    falling = pose @ turn.swapaxes(-1, -2) + rng.normal(0.0, 0.02, size=(48, WINDOW, ROWS, 2))
    noise = rng.normal(0.0, 1.0, size=(16, WINDOW, ROWS, 2)) * rng.uniform(0.1, 3.0, size=(16, 1, 1, 1))
    return np.concatenate([falling, noise]).astype(np.float32)


def compare(graph: Path, judge: Judge, windows: NDArray[np.float32]) -> dict[str, float]:
    """Return the largest difference between a graph in ONNX Runtime and PyTorch, for each output and any batch size."""
    import onnxruntime  # noqa: PLC0415 (an extra)

    session = onnxruntime.InferenceSession(str(graph), providers=["CPUExecutionProvider"])
    worst = dict.fromkeys((PROBABILITIES, FORECAST), 0.0)
    for size in _BATCHES:
        for first in range(0, len(windows) - size + 1, size):
            batch = windows[first : first + size]
            with torch.inference_mode():
                expected = judge(torch.from_numpy(batch))
            for name, said, truth in zip(worst, session.run(list(worst), {WINDOW_NAME: batch}), expected, strict=True):
                difference = float(np.abs(said - truth.numpy()).max())
                worst[name] = difference if not difference <= worst[name] else worst[name]  # NaN stays
    return worst


def _graph(judge: Judge) -> bytes:
    """Trace the network; batches of any size may be given to the graph.

    The tracing exporter is used: the newer one takes ten times as long, and longer for an LSTM.
    """
    names = (WINDOW_NAME, PROBABILITIES, FORECAST)
    with TemporaryDirectory() as scratch, warnings.catch_warnings():
        traced = Path(scratch) / GRAPH_FILE
        warnings.filterwarnings("ignore", "You are using the legacy TorchScript-based ONNX export", DeprecationWarning)
        warnings.filterwarnings("ignore", "The feature will be removed", DeprecationWarning)  # of its own parts
        # an LSTM compares the width of its input, which no batch changes
        warnings.filterwarnings("ignore", category=Warning, module=r"torch\.nn\.modules\.rnn")
        warnings.filterwarnings(
            "ignore", "Exporting a model to ONNX with a batch_size other than 1", UserWarning
        )  # LSTM
        torch.onnx.export(
            judge,
            (torch.zeros(2, WINDOW, ROWS, 2),),
            traced,
            dynamo=False,
            opset_version=OPSET,
            input_names=[WINDOW_NAME],
            output_names=[PROBABILITIES, FORECAST],
            dynamic_axes={name: {0: "batch"} for name in names},
        )
        return traced.read_bytes()


def _describe(checkpoint: Checkpoint, origin: str, differences: dict[str, float]) -> dict[str, Any]:
    """Say what goes into the graph and what comes out, for a person and for a program."""
    rows = [*NAMES, "velocity of the centre"][:ROWS]
    frame = {
        "axes": ["batch", "frame", "row", "x right, y down"],
        "rows": rows,
        "unit": "body lengths, relative to the upper-body centre (mean of shoulders and hips)",
    }
    if len(NAMES) < ROWS:
        frame["last row"] = "how far the upper-body centre moves through the image in 0.2 s, in body lengths"
    return {
        "made by": "surefoot export",
        "checkpoint": origin,
        "graph": GRAPH_FILE,
        "opset": OPSET,
        "inputs": {
            WINDOW_NAME: {
                "type": "float32",
                "shape": ["batch", WINDOW, ROWS, 2],
                **frame,
                "time": f"{WINDOW} frames at 30 Hz, oldest first, the last is now",
                "normalisation": "perception.features: (p - centre) / body length, a slowly adapting length in pixels; "
                "a lost keypoint is held at its last place relative to the body (anticipation.window)",
            }
        },
        "outputs": {
            PROBABILITIES: {
                "type": "float32",
                "shape": ["batch", STEPS, len(CLASSES)],
                "classes": list(CLASSES),
                "steps_s": [round(step * STEP_S, 4) for step in range(STEPS)],
                "calibrated": "temperatures are applied; quality (anticipation.quality) is not",
            },
            FORECAST: {
                "type": "float32",
                "shape": ["batch", HORIZON, ROWS, 2],
                **frame,
                "time": f"the {HORIZON} frames after now, at 30 Hz",
            },
        },
        "temperature": [float(value) for value in checkpoint.temperature],
        "largest_difference_to_pytorch": differences,
        "data": list(checkpoint.provenance.data),
        "licence": checkpoint.provenance.licence,
    }
