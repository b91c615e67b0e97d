"""Calibration: how likely labels are under probabilities, and the temperatures that make them likeliest."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from bridge.messages import Floats

STEPS: Final = (0, 3, 6, 9, 12, 15)  # 0, 100, ..., 500 ms: the columns of the paper's table
TEMPERATURES: Final = np.geomspace(0.4, 4.0, 47)


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
