"""Every number of an evaluation as JSON, from the predictions alone; docs/evaluation.md describes the layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from anticipation.training.clips import UNLABELLED
from anticipation.training.evaluation.calibration import (
    Said,
    cross_fitted,
    expected_error,
    fitted,
    reliability,
    said,
    tempered,
)
from anticipation.training.evaluation.records import Predictions, Record
from anticipation.training.evaluation.scores import (
    SHIPPED,
    Judged,
    Relabel,
    accuracy,
    by_step,
    confusion,
    dataset_labels,
    forecast_errors,
    judged,
    macro_f1,
    mean_error,
)
from anticipation.training.measures import STEPS as TABLE_STEPS
from bridge.messages import STEP_S, STEPS, Floats

FORMAT: Final = 1
ENDS: Final = (TABLE_STEPS[0], TABLE_STEPS[-1])  # present and half a second: where matrices and diagrams are drawn


def results_of(predictions: Predictions) -> dict[str, Any]:
    """Return all numbers that follow from stored predictions."""
    keypoints = str(predictions.meta["keypoints"])
    falls = predictions.of("fall", estimator="" if keypoints == "both" else keypoints)
    tables: dict[str, Any] = {"urfd": _table(falls)}
    others = [record for record in predictions.of("fall") if record not in falls and record.ticks is not None]
    if others:
        tables["urfd_other_tracks"] = _table(others)
    staged = [record for record in predictions.of("staged") if record.ticks is not None]
    if staged:
        tables["upfall"] = _table(staged)
    if falls:
        tables["urfd_every_horizon"] = _table(falls, every_tick=True)
    return {
        "format": FORMAT,
        **{name: predictions.meta[name] for name in ("protocol", "seed", "parts", "keypoints", "forecaster")},
        "shipped": SHIPPED,
        "horizons_ms": [_ms(step) for step in TABLE_STEPS],
        "error_horizons_ms": [_ms(step) for step in range(1, STEPS)],
        "tables": tables,
        "forecast_error": _forecast_error(falls) if falls else {},
        **_calibration(predictions, falls, keypoints),
    }


def _table(records: Sequence[Record], relabel: Relabel = dataset_labels, every_tick: bool = False) -> dict[str, Any]:
    """Accuracy, macro-F1 and confusion of some records, part by part."""
    parts = judged(records, relabel, every_tick)
    names = list(next(iter(parts.values())).said) if parts else []
    tested = sum(int((each.truth[:, 0] >= 0).sum()) for each in parts.values())
    labelled = sum(int((relabel(record) != UNLABELLED).sum()) for record in records if record.ticks is not None)
    return {
        "parts": list(parts),
        "clips": sum(record.ticks is not None for record in records),
        "tested_frames": tested,
        "excluded_frames": labelled - tested,
        "accuracy": {name: [by_step(each, name, accuracy, TABLE_STEPS) for each in parts.values()] for name in names},
        "macro_f1": {name: [by_step(each, name, macro_f1, TABLE_STEPS) for each in parts.values()] for name in names},
        "confusion": {str(_ms(step)): _confusion(parts, step) for step in ENDS},
    }


def _confusion(parts: Mapping[int, Judged], step: int) -> list[list[int]]:
    total = sum(
        (confusion(each.truth[:, step], each.said[SHIPPED][:, step]) for each in parts.values()),
        start=np.zeros((3, 3), dtype=np.int64),
    )
    counts: list[list[int]] = total.tolist()
    return counts


def _forecast_error(falls: Sequence[Record]) -> dict[str, Any]:
    """Mean error at each of the 15 steps, of every part: over all ticks and while falling, in body lengths and px."""
    parts = forecast_errors(falls)
    names = list(next(iter(parts.values())).body) if parts else []
    return {
        f"{kind}_{unit}": {
            name: [
                _rounded(mean_error(each, name, falling=kind == "falling", px=unit == "px")) for each in parts.values()
            ]
            for name in names
        }
        for kind in ("all", "falling")
        for unit in ("body", "px")
    }


def _calibration(predictions: Predictions, falls: Sequence[Record], keypoints: str) -> dict[str, Any]:
    """Temperatures, and the calibration error before and after: each part's temperatures come from the other parts."""
    parts = len(predictions.meta["parts"])
    everything = said(falls)
    by_part = np.array(cross_fitted(falls, parts, keypoints))  # (parts, 16)
    after = tempered(everything.probabilities, by_part[everything.part])
    return {
        "temperature": _rounded(fitted(everything)),
        "calibration": {
            "temperatures": [_rounded(row) for row in by_part],
            "error_before": _rounded(expected_error(everything.probabilities, everything.labels)),
            "error_after": _rounded(expected_error(after, everything.labels)),
            "by_part": _by_part(everything, after, parts),
            "reliability": {
                str(_ms(step)): {
                    "before": _bins(everything.probabilities, everything, step),
                    "after": _bins(after, everything, step),
                }
                for step in ENDS
            },
        },
    }


def _by_part(heard: Said, after: Floats, parts: int) -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = {"error_before": [], "error_after": []}
    for part in range(parts):
        mine = heard.part == part
        for name, probabilities in (("error_before", heard.probabilities), ("error_after", after)):
            found[name].append(_rounded(expected_error(probabilities[mine], heard.labels[mine])))
    return found


def _bins(probabilities: Floats, heard: Said, step: int) -> list[list[float]]:
    there = heard.labels[:, step] >= 0
    bins = reliability(probabilities[there, step], heard.labels[there, step])
    return [[each.size, round(each.confidence, 4), round(each.accuracy, 4)] for each in bins]


def _ms(step: int) -> int:
    return round(1000 * step * STEP_S)


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 4) for value in values]
