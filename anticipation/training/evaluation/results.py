"""Every number of an evaluation as JSON, from the predictions alone; docs/evaluation.md describes the layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from anticipation.training.clips import FALL, UNLABELLED
from anticipation.training.evaluation.calibration import (
    Said,
    cross_fitted,
    expected_error,
    fitted,
    reliability,
    said,
    tempered,
)
from anticipation.training.evaluation.events import calm, fall_of, together
from anticipation.training.evaluation.onset import dataset_onset, physical_labels, physical_onset
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
from anticipation.training.evaluation.transient import descents
from anticipation.training.measures import STEPS as TABLE_STEPS
from bridge.messages import STEP_S, STEPS, Floats

FORMAT: Final = 1
ENDS: Final = (TABLE_STEPS[0], TABLE_STEPS[-1])  # present and half a second: where matrices and diagrams are drawn


def results_of(predictions: Predictions) -> dict[str, Any]:
    """Return all numbers that follow from stored predictions; what is not known is None."""
    keypoints = str(predictions.meta["keypoints"])
    falls = predictions.of("fall", estimator="" if keypoints == "both" else keypoints)
    ticked = [record for record in falls if record.ticks is not None]
    others = [record for record in predictions.of("fall") if record not in falls and record.ticks is not None]
    staged = [record for record in predictions.of("staged") if record.ticks is not None]
    tables = {
        "urfd": _table(ticked),
        "urfd_every_horizon": _table(ticked, every_tick=True),
        "urfd_other_tracks": _table(others),
        "upfall": _table(staged),
        "urfd_physical": _table(ticked, physical_labels),
        "upfall_physical": _table(staged, physical_labels),
    }
    results = {
        "format": FORMAT,
        **{name: predictions.meta[name] for name in ("protocol", "seed", "parts", "keypoints", "forecaster")},
        "shipped": SHIPPED,
        "horizons_ms": [_ms(step) for step in TABLE_STEPS],
        "error_horizons_ms": [_ms(step) for step in range(1, STEPS)],
        "tables": {name: table for name, table in tables.items() if table},
        "forecast_error": _forecast_error(ticked) if ticked else {},
        **_calibration(predictions, ticked, keypoints),
        "onset": {"urfd": _onsets(ticked), "upfall": _onsets(staged)},
        "transient": [each._asdict() for each in descents(predictions, ticked)],
        **_whole_system(predictions, falls),
    }
    plain: dict[str, Any] = _plain(results)
    return plain


def _onsets(records: Sequence[Record]) -> dict[str, Any]:
    """Compare the data set's onset with the physical one: times before lying, and labels tick by tick.

    `agreement` is the share of tested ticks on which both call the person the same: the accuracy that a perfect
    predictor of one would have under the other.
    """
    clips, same, ticks_seen = [], 0, 0
    for record in records:
        ticks = record.ticks
        assert ticks is not None
        lying, found = np.flatnonzero(ticks.labels == FALL), physical_onset(ticks)
        begun = dataset_onset(ticks.labels)
        if not len(lying) or begun is None:
            continue
        clips.append(
            {
                "name": record.name,
                "dataset_s": (int(lying[0]) - begun) * STEP_S,
                "physical_s": None if found is None else (int(lying[0]) - found) * STEP_S,
            }
        )
        one, other = ticks.labels, physical_labels(record)
        there = ticks.tested & ticks.valid & (one >= 0) & (other >= 0)
        same += int((one[there] == other[there]).sum())
        ticks_seen += int(there.sum())
    return {"clips": clips, "ticks": ticks_seen, "agreement": same / ticks_seen if ticks_seen else None}


def _whole_system(predictions: Predictions, falls: Sequence[Record]) -> dict[str, Any]:
    """Events and interventions of the live pass; empty if there was none."""
    staged = predictions.of("staged")
    found = {
        "urfd": [fall for fall in map(fall_of, falls) if fall],
        "upfall": [fall for fall in map(fall_of, staged) if fall],
    }
    everything = [fall for each in found.values() for fall in each]
    activities = calm(predictions.records)
    if not everything and not activities:
        return {}
    return {
        "events": {
            **{name: together(each)._asdict() for name, each in found.items()},
            "all": together(everything)._asdict(),
            "falls": [fall._asdict() for fall in everything],
        },
        "daily": [each._asdict() for each in activities],
    }


def _plain(value: Any) -> Any:
    """Return what JSON can say: numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        return round(float(value), 4) if np.isfinite(value) else None
    return value


def _table(records: Sequence[Record], relabel: Relabel = dataset_labels, every_tick: bool = False) -> dict[str, Any]:
    """Accuracy, macro-F1 and confusion of some records, part by part."""
    parts = judged(records, relabel, every_tick)
    if not parts:
        return {}
    names = list(next(iter(parts.values())).said)
    tested = sum(int((each.truth[:, 0] >= 0).sum()) for each in parts.values())
    labelled = sum(int((relabel(record) != UNLABELLED).sum()) for record in records)
    pooled = Judged(
        np.concatenate([each.truth for each in parts.values()]),
        {name: np.concatenate([each.said[name] for each in parts.values()]) for name in names},
    )
    scores = {"accuracy": accuracy, "macro_f1": macro_f1}
    return {
        "parts": list(parts),
        "clips": len(records),
        "tested_frames": tested,
        "excluded_frames": labelled - tested,
        **{
            kind: {name: [by_step(each, name, score, TABLE_STEPS) for each in parts.values()] for name in names}
            for kind, score in scores.items()
        },
        "pooled": {
            kind: {name: by_step(pooled, name, score, TABLE_STEPS) for name in names} for kind, score in scores.items()
        },
        "confusion": {
            str(_ms(step)): confusion(pooled.truth[:, step], pooled.said[SHIPPED][:, step]).tolist() for step in ENDS
        },
    }


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
