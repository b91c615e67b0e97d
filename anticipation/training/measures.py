"""Numbers for a table: accuracy and macro-F1 of a horizon, forecast error, calibration."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anticipation.motion import HORIZON, WINDOW
from anticipation.training.clips import FALL, TRANSIENT
from anticipation.training.samples import Samples
from bridge.messages import Floats

STEPS: Final = (0, 3, 6, 9, 12, 15)  # 0, 100, ..., 500 ms
ERROR_STEPS: Final = (3, 9, 15)  # 100, 300, 500 ms
TEMPERATURES: Final = np.geomspace(0.4, 4.0, 47)


class Score(NamedTuple):
    """How often the class was right at each of `STEPS`, in 0..1."""

    accuracy: Floats  # (6,)
    macro_f1: Floats  # (6,)


class ForecastError(NamedTuple):
    """Mean distance between foreseen and true keypoints at each of `ERROR_STEPS`."""

    all_body: Floats  # (3,) [body lengths]
    all_px: Floats  # (3,) [px]
    falling_body: Floats  # (3,) while falling [body lengths]
    falling_px: Floats  # (3,) [px]


def score(predicted: NDArray[np.int64], samples: Samples) -> Score:
    """Score predictions (M, 16), made at frame t, against the labels of frames t + h that exist."""
    accuracy, macro_f1 = [], []
    for step in STEPS:
        there = samples.labels[:, step] >= 0
        truth, said = samples.labels[there, step], predicted[there, step]
        accuracy.append(float((truth == said).mean()) if len(truth) else np.nan)
        macro_f1.append(_macro_f1(truth, said))
    return Score(np.array(accuracy), np.array(macro_f1))


def _macro_f1(truth: NDArray[np.int64], said: NDArray[np.int64]) -> float:
    """Mean over the classes that occur of 2 TP / (2 TP + FP + FN)."""
    values = []
    for kind in range(FALL + 1):
        hit = int(((truth == kind) & (said == kind)).sum())
        wrong = int(((truth == kind) != (said == kind)).sum())
        if hit + wrong:
            values.append(2 * hit / (2 * hit + wrong))
    return float(np.mean(values)) if values else float("nan")


def forecast_error(futures: NDArray[np.float32], samples: Samples) -> ForecastError:
    """Mean error of futures (M, 15, 12, 2), over known frames; relative coordinates, so the body's path is left out."""
    error = np.linalg.norm(futures - samples.poses[:, WINDOW:], axis=-1).mean(axis=-1)  # (M, 15) [body lengths]
    known = samples.known[:, WINDOW:]
    falling = known & (samples.labels[:, 1 : HORIZON + 1] == TRANSIENT)
    rows = [
        [_mean(scaled[:, step - 1], mask[:, step - 1]) for step in ERROR_STEPS]
        for mask in (known, falling)
        for scaled in (error, error * samples.body_px[:, None])
    ]
    return ForecastError(*(np.array(row) for row in rows))


def _mean(values: NDArray[np.floating], mask: NDArray[np.bool_]) -> float:
    return float(values[mask].mean()) if mask.any() else float("nan")


def log_likelihood(logits: NDArray[np.floating], labels: NDArray[np.int64], temperature: float) -> float:
    """Mean log-probability of labels (N,) under logits (N, 3) divided by a temperature."""
    scaled = logits / temperature
    scaled = scaled - scaled.max(axis=1, keepdims=True)
    normaliser = np.log(np.exp(scaled).sum(axis=1))
    return float((scaled[np.arange(len(labels)), labels] - normaliser).mean())


def temperatures(logits: NDArray[np.floating], labels: NDArray[np.int64]) -> Floats:
    """Return for each step the temperature with the best likelihood on held-out logits (M, 16, 3), (16,).

    Guo et al., "On Calibration of Modern Neural Networks", ICML 2017; the best of a geometric grid.
    """
    best = []
    for step in range(labels.shape[1]):
        there = labels[:, step] >= 0
        values = [log_likelihood(logits[there, step], labels[there, step], value) for value in TEMPERATURES]
        best.append(TEMPERATURES[int(np.argmax(values))] if there.any() else 1.0)
    return np.array(best)


def calibration_error(probabilities: NDArray[np.floating], labels: NDArray[np.int64], bins: int = 10) -> float:
    """Expected calibration error of probabilities (N, 3): confidence against accuracy in equal bins."""
    confidence, hit = probabilities.max(axis=1), probabilities.argmax(axis=1) == labels
    bin_of = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = [
        abs(confidence[bin_of == index].mean() - hit[bin_of == index].mean()) * (bin_of == index).mean()
        for index in range(bins)
        if (bin_of == index).any()
    ]
    return float(np.sum(gaps))
