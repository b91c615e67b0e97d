"""One anticipation step, from a detection to the fall-state horizon, in parts and whole, on one core.

    python -m benchmarks.anticipation --json runs/bench/anticipation.json

The weights that come with the package, or those of --checkpoint, or untrained networks of the same kind.
The yardstick in the same run is what the paper's networks cost without any of this: the LSTM of its Table 1 with
a direct head and the classifier on sixteen separate windows, both in eager torch.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from anticipation.checkpoint import SHIPPED, Checkpoint, load
from anticipation.fast_gait_state import FastDirectedGraph
from anticipation.fast_motion import fast_forecast
from anticipation.gait_state import DirectedGraphNetwork
from anticipation.motion import LstmForecaster, MlpForecaster
from anticipation.outlook import Outlook
from anticipation.predictor import Predictor
from anticipation.quality import PoseStatistics
from anticipation.transient import TransientPlane
from benchmarks.report import machine, percentiles
from bridge.clock import NS
from bridge.config.anticipation import AnticipationConfig
from bridge.config.perception import CleaningConfig
from bridge.messages import Keypoints
from perception.cleaning import Cleaner, CleanFrame

LIMIT_MS = 5.0  # design: p99 of the step, cleaning to horizon
TIMES_FASTER = 4.0  # than the yardstick, in the same run

STANDING = np.array(
    [(-20, -32), (20, -32), (-28, 4), (28, 4), (-30, 36), (30, 36), (-14, 32), (14, 32),
     (-16, 92), (16, 92), (-16, 148), (16, 148)]
)  # fmt: skip


def detections(frames: int) -> np.ndarray:
    """A person who walks in place, as a detector sees one: jitter and a point missing now and then (N, 12, 3)."""
    random = np.random.default_rng(0)
    swing = 15.0 * np.sin(2 * np.pi * np.arange(frames) / 30)[:, None]
    points = np.repeat(STANDING[None] + np.array([320.0, 200.0]), frames, axis=0)
    points[:, [2, 4, 9, 11], 0] += swing
    points[:, [3, 5, 8, 10], 0] -= swing
    points += random.normal(0, 1.5, points.shape)
    points[random.random((frames, 12)) < 0.02] = np.nan
    confidence = np.where(np.isnan(points[..., :1]), np.nan, 0.9)
    return np.concatenate((points, confidence), axis=2)


def untrained() -> Checkpoint:
    """Networks of the shipped kind with random weights: they cost what trained ones cost."""
    random = np.random.default_rng(0)
    return Checkpoint(
        forecaster=MlpForecaster().eval(),
        classifier=DirectedGraphNetwork(centre=True).eval(),
        outlook=Outlook().eval(),
        plane=TransientPlane(
            "window", random.normal(0, 0.1, (360, 2)), np.zeros(2), np.eye(3, 2), np.eye(3, 2), np.zeros(3)
        ),
        statistics=PoseStatistics(np.zeros(36), np.eye(36), 1.0, np.array([0.1, 10.0])),
        temperature=np.ones(16),
    )


class Took:
    """Durations by the wall's clock and on the core [ms]: on a busy machine the second is nearer to an idle one's."""

    def __init__(self) -> None:
        self.wall: list[float] = []
        self.core: list[float] = []

    def start(self) -> None:
        """Begin a turn."""
        self._core_ns, self._wall_ns = time.thread_time_ns(), time.perf_counter_ns()

    def stop(self) -> None:
        """End a turn."""
        wall_ns, core_ns = time.perf_counter_ns(), time.thread_time_ns()
        self.wall.append((wall_ns - self._wall_ns) / 1e6)
        self.core.append((core_ns - self._core_ns) / 1e6)

    def table(self) -> dict[str, dict[str, float]]:
        """Percentiles of both."""
        return {"wall": percentiles(self.wall), "core": percentiles(self.core)}


def timed(action: Callable[[], Any], times: int) -> Took:
    """Time `times` calls, after a few that do not count."""
    for _ in range(10):
        action()
    took = Took()
    for _ in range(times):
        took.start()
        action()
        took.stop()
    return took


def step_durations(checkpoint: Checkpoint, frames: int) -> dict[str, Took]:
    """Time cleaning, and the whole step, for each frame after the first two seconds."""
    cleaner = Cleaner(CleaningConfig())
    predictor = Predictor(checkpoint, AnticipationConfig(min_quality=0.0))
    predictor.warm_up()
    cleaning, whole = Took(), Took()
    for number, frame in enumerate(detections(frames + 60)):
        if number == 60:
            cleaning, whole = Took(), Took()
        whole.start()
        cleaning.start()
        ticks = cleaner.push(frame, round((1 + number / 30) * NS))
        cleaning.stop()
        for tick in ticks:
            predictor.push(as_message(tick))
        predictor.predict()
        whole.stop()
    return {"cleaning": cleaning, "whole step": whole}


def as_message(tick: CleanFrame) -> Keypoints:
    """What perception would publish of a clean tick."""
    return Keypoints(**tick._asdict(), image_width=640, image_height=480)


def measure(checkpoint: Checkpoint, times: int) -> dict[str, Any]:
    """Measure every part on one thread."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    frames = torch.randn(1, 30, 13, 2)
    window = frames[:, :15].contiguous()
    windows = torch.cat([frames[:, first : first + 15] for first in range(16)])
    lstm = LstmForecaster().eval()
    forecast, classifier = checkpoint.forecast, checkpoint.classifier
    quick_forecast, quick_classifier, quick_lstm = (
        fast_forecast(forecast),
        FastDirectedGraph(classifier),
        fast_forecast(lstm),
    )
    gc.collect()
    gc.freeze()
    steps = step_durations(checkpoint, times)
    with torch.inference_mode():
        parts = {
            **steps,
            "forecaster": timed(lambda: quick_forecast(window), times),
            "classifier, one pass": timed(lambda: quick_classifier(frames), times),
            "classifier, one pass, eager": timed(lambda: classifier(frames), times),
            "classifier, 16 windows, eager": timed(lambda: classifier(windows), times),
            "LSTM direct": timed(lambda: quick_lstm(window), times // 4),
            "LSTM direct, eager": timed(lambda: lstm(window), times // 4),
            "LSTM direct + 16 windows, eager": timed(lambda: (lstm(window), classifier(windows)), times // 4),
        }
    table = {name: took.table() for name, took in parts.items()}
    name = forecast if isinstance(forecast, str) else type(forecast).__name__
    return {
        "machine": machine(),
        "forecaster": getattr(forecast, "__name__", name),
        "limit_ms": LIMIT_MS,
        "parts": table,
        "one pass is faster than 16 windows": ratio(table, "classifier, 16 windows, eager", "classifier, one pass"),
        "step is faster than the yardstick": ratio(table, "LSTM direct + 16 windows, eager", "whole step"),
        "wanted": TIMES_FASTER,
    }


def ratio(table: dict[str, dict[str, dict[str, float]]], slow: str, quick: str) -> float:
    """How many times less time on the core, by the medians."""
    return round(table[slow]["core"]["p50_ms"] / table[quick]["core"]["p50_ms"], 2)


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=2000)
    parser.add_argument("--checkpoint", type=Path)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    if arguments.checkpoint is None and not SHIPPED.is_file():
        checkpoint, weights = untrained(), "untrained"
    else:
        checkpoint, weights = load(arguments.checkpoint), str(arguments.checkpoint or "shipped")
    result = {"weights": weights, **measure(checkpoint, arguments.times)}
    text = json.dumps(result, indent=2)
    print(text)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
