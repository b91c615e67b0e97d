"""How far a probability can be taken at its word, and the temperatures that mend it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anticipation.training.evaluation.records import Record
from anticipation.training.measures import calibration_error, temperatures
from bridge.messages import STEPS, Floats

BINS: Final = 10


class Said(NamedTuple):
    """Predictions made at tested ticks, with what came true."""

    probabilities: Floats  # (M, 16, 3) before calibration
    labels: NDArray[np.int64]  # (M, 16), negative where unknown
    part: NDArray[np.int64]  # (M,)


def said(records: Sequence[Record], every_tick: bool = False) -> Said:
    """Collect the horizons of tested ticks; with `every_tick` also those whose window was not whole."""
    probabilities, labels, part = [np.zeros((0, STEPS, 3))], [np.zeros((0, STEPS), np.int64)], [np.zeros(0, np.int64)]
    for record in records:
        ticks = record.ticks
        if ticks is None:
            continue
        there = ticks.valid if every_tick else ticks.valid & ticks.tested
        probabilities.append(ticks.probabilities[there].astype(np.float64))
        labels.append(ahead(ticks.labels)[there])
        part.append(np.full(int(there.sum()), record.part))
    return Said(np.concatenate(probabilities), np.concatenate(labels), np.concatenate(part))


def ahead(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the labels of the present and the next 15 ticks, (T,) -> (T, 16); -100 past the end."""
    padded = np.concatenate([labels, np.full(STEPS - 1, -100, dtype=np.int64)])
    return np.lib.stride_tricks.sliding_window_view(padded, STEPS)[: len(labels)]


def tempered(probabilities: Floats, temperature: Floats) -> Floats:
    """Return probabilities (..., 16, 3) whose logits are divided by a temperature (16,) or (..., 16)."""
    with np.errstate(divide="ignore"):
        logits = np.log(probabilities) / np.asarray(temperature)[..., None]
    weights = np.exp(logits - logits.max(axis=-1, keepdims=True))
    scaled: Floats = weights / weights.sum(axis=-1, keepdims=True)
    return scaled


def fitted(heard: Said) -> Floats:
    """Return the likeliest temperature of each step, (16,)."""
    if not len(heard.labels):
        return np.ones(STEPS)
    return temperatures(np.log(np.maximum(heard.probabilities, 1e-12)), heard.labels)


def cross_fitted(records: Sequence[Record], parts: int, keypoints: str) -> list[Floats]:
    """Return for each part the temperatures that fit the URFD falls of all others; ones where there are no others."""
    falls = [record for record in records if record.kind == "fall" and _by(record, keypoints)]
    found = []
    for part in range(parts):
        others = said([record for record in falls if record.part != part])
        found.append(fitted(others))
    return found


def _by(record: Record, keypoints: str) -> bool:
    return keypoints == "both" or record.name.endswith(keypoints)


def expected_error(probabilities: Floats, labels: NDArray[np.int64]) -> Floats:
    """Return the expected calibration error at each step, (M, 16, 3) and (M, 16) -> (16,); NaN where nothing is known.

    Ten equal bins of the largest probability (Guo et al., "On Calibration of Modern Neural Networks", ICML 2017).
    """
    errors = []
    for step in range(labels.shape[1]):
        there = labels[:, step] >= 0
        errors.append(
            calibration_error(probabilities[there, step], labels[there, step], BINS) if there.any() else np.nan
        )
    return np.array(errors)


class Bin(NamedTuple):
    """Predictions of about the same confidence."""

    size: int
    confidence: float  # mean of the largest probability
    accuracy: float  # how often its class came true


def reliability(probabilities: Floats, labels: NDArray[np.int64]) -> list[Bin]:
    """Sort predictions (M, 3) with known labels (M,) into ten equal bins of confidence; empty bins are left out."""
    confidence, hit = probabilities.max(axis=1), probabilities.argmax(axis=1) == labels
    index = np.minimum((confidence * BINS).astype(int), BINS - 1)
    return [
        Bin(int((index == at).sum()), float(confidence[index == at].mean()), float(hit[index == at].mean()))
        for at in range(BINS)
        if (index == at).any()
    ]
