"""How often the class was right, and how far the foreseen keypoints lay from the true ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anticipation.motion import HORIZON
from anticipation.training.clips import TRANSIENT, Labels
from anticipation.training.evaluation.calibration import ahead
from anticipation.training.evaluation.records import Record, Ticks
from bridge.messages import CLASSES, STEPS, Floats

Classes = NDArray[np.int64]
Relabel = Callable[[Record], Labels]

SHIPPED: Final = "as shipped"
MAJORITY: Final = "majority class"
ZERO: Final = "zero velocity"
CONSTANT: Final = "constant velocity"


def dataset_labels(record: Record) -> Labels:
    """Return the labels of the data set, (T,)."""
    assert record.ticks is not None
    return record.ticks.labels


class Judged(NamedTuple):
    """What was said and what came true at the same ticks of one part."""

    truth: Classes  # (M, 16), negative where unknown
    said: Mapping[str, Classes]  # (M, 16) by each way, -1 where it says nothing


def judged(records: Sequence[Record], relabel: Relabel = dataset_labels, every_tick: bool = False) -> dict[int, Judged]:
    """Collect predictions by part.

    Of each clip the ticks count that end a whole window; with `every_tick`, all that have a horizon.
    """
    found: dict[int, list[tuple[Classes, dict[str, Classes]]]] = {}
    for record in records:
        ticks = record.ticks
        if ticks is None:
            continue
        there = ticks.valid & (True if every_tick else ticks.tested)
        said = {SHIPPED: np.nan_to_num(ticks.probabilities[there]).argmax(axis=-1)}
        said |= {name: classes[there].astype(np.int64) for name, classes in ticks.rows.items()}
        found.setdefault(record.part, []).append((ahead(relabel(record))[there], said))
    return {part: _joined(each) for part, each in sorted(found.items())}


def _joined(pieces: list[tuple[Classes, dict[str, Classes]]]) -> Judged:
    truth = np.concatenate([each for each, _ in pieces])
    said = {name: np.concatenate([each[name] for _, each in pieces]) for name in pieces[0][1]}
    known = truth[truth >= 0]
    most = np.bincount(known).argmax() if len(known) else 0
    return Judged(truth, {**said, MAJORITY: np.full(truth.shape, most)})


def accuracy(truth: Classes, said: Classes) -> float:
    """Share of predictions (M,) that came true, where both are known; NaN where there are none."""
    there = (truth >= 0) & (said >= 0)
    return float((truth[there] == said[there]).mean()) if there.any() else float("nan")


def confusion(truth: Classes, said: Classes) -> NDArray[np.int64]:
    """Count predictions: (3, 3), rows what was true, columns what was said."""
    there = (truth >= 0) & (said >= 0)
    counts = np.zeros((len(CLASSES), len(CLASSES)), dtype=np.int64)
    np.add.at(counts, (truth[there], said[there]), 1)
    return counts


def macro_f1(truth: Classes, said: Classes) -> float:
    """Mean over the classes that occur of 2 TP / (2 TP + FP + FN); NaN where nothing is known."""
    counts = confusion(truth, said)
    hit = np.diag(counts)
    either = counts.sum(axis=0) + counts.sum(axis=1)
    there = either > 0
    return float((2 * hit[there] / either[there]).mean()) if there.any() else float("nan")


def by_step(
    judgement: Judged, row: str, score: Callable[[Classes, Classes], float], steps: Sequence[int]
) -> list[float]:
    """Return a score at each of `steps`."""
    return [score(judgement.truth[:, step], judgement.said[row][:, step]) for step in steps]


class Errors(NamedTuple):
    """Mean distance over the twelve keypoints for M ticks and 15 steps; NaN where the future is not known."""

    body: Mapping[str, Floats]  # (M, 15) by each forecast [body lengths]
    body_px: Floats  # (M,) body length at the present [px]
    falling: NDArray[np.bool_]  # (M, 15) the person is falling at that step


def forecast_errors(records: Sequence[Record]) -> dict[int, Errors]:
    """Compare forecasts with what came, in relative coordinates: the body's path through the image is left out."""
    found: dict[int, list[tuple[dict[str, Floats], Floats, NDArray[np.bool_]]]] = {}
    for record in records:
        ticks = record.ticks
        if ticks is not None:
            found.setdefault(record.part, []).append(_errors(ticks))
    joined = {}
    for part, pieces in sorted(found.items()):
        body = {name: np.concatenate([each[name] for each, _, _ in pieces]) for name in pieces[0][0]}
        joined[part] = Errors(
            body, np.concatenate([px for _, px, _ in pieces]), np.concatenate([each for _, _, each in pieces])
        )
    return joined


def _errors(ticks: Ticks) -> tuple[dict[str, Floats], Floats, NDArray[np.bool_]]:
    present = np.flatnonzero(ticks.valid & ticks.tested)
    steps = np.arange(1, STEPS)
    last = len(ticks) - 1
    future = np.minimum(present[:, None] + steps, last)  # (M, 15)
    known = (present[:, None] + steps <= last) & ticks.whole[future]
    truth = np.where(known[..., None, None], ticks.poses[future], np.nan)
    now = ticks.poses[present][:, None]  # (M, 1, 12, 2)
    slope = (now - ticks.poses[np.maximum(present - 2, 0)][:, None]) / 2
    foreseen = {
        SHIPPED: ticks.forecast[present].astype(np.float64),
        ZERO: np.repeat(now, HORIZON, axis=1),
        CONSTANT: now + steps[:, None, None] * slope,
    }
    errors = {name: np.linalg.norm(each - truth, axis=-1).mean(axis=-1) for name, each in foreseen.items()}
    falling = known & (ahead(ticks.labels)[present][:, 1:] == TRANSIENT)
    return errors, ticks.body_px[present].astype(np.float64), falling


def mean_error(errors: Errors, name: str, falling: bool, px: bool) -> Floats:
    """Return the mean error of a forecast at each of the 15 steps, over all ticks or over those while falling."""
    values = errors.body[name] * (errors.body_px[:, None] if px else 1.0)
    values = np.where(errors.falling, values, np.nan) if falling else values
    there = np.isfinite(values)
    total, count = np.where(there, values, 0.0).sum(axis=0), there.sum(axis=0)
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))
