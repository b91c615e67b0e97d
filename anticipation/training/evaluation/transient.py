"""What the transient planes say in the last second of a fall, and what they lose against the classifier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from anticipation.training.clips import FALL
from anticipation.training.evaluation.records import Predictions, Record, Ticks

Values = NDArray[np.floating]
Judge = Callable[[Record, Ticks], tuple[Values, Values]]
"""Distance to the fall boundary and region at each tick, (T,) each; NaN where there is none."""

SHIPPED: Final = "as shipped"
LAST: Final = 30  # ticks: the last second
FEWEST: Final = 8  # ticks that make a correlation


class Descent(NamedTuple):
    """One plane over all falls."""

    name: str
    correlations: list[float]  # Spearman of distance with time to impact, one for each fall that can be judged
    clips: list[str]
    median: float
    worst_tenth: float  # a tenth of the falls lies below
    share: float  # of the falls with 0.8 or more
    accuracy: float  # of the three regions, present step
    classifier: float  # accuracy of the full classifier at the same ticks


def descents(predictions: Predictions, falls: Sequence[Record]) -> list[Descent]:
    """Judge the shipped plane and every rival on the same falls."""
    rivals = [name for record in falls[:1] if record.ticks is not None for name in record.ticks.planes]
    planes: list[tuple[str, Judge]] = [(SHIPPED, _shipped(predictions)), *((name, _rival(name)) for name in rivals)]
    return [_descent(name, judge, falls) for name, judge in planes]


def correlation(distance: Values, lying: int, there: NDArray[np.bool_]) -> float:
    """Spearman's correlation of a distance (T,) with the time to impact over the last second before tick `lying`.

    1 where the distance shrinks at every step; NaN where fewer than eight ticks of that second can be judged.
    """
    ticks = np.arange(max(0, lying - LAST), lying)
    ticks = ticks[there[ticks] & np.isfinite(distance[ticks])]
    values = distance[ticks]
    if len(ticks) < FEWEST or np.ptp(values) == 0.0:
        return float("nan")
    return float(spearmanr(values, lying - ticks).statistic)


def _descent(name: str, judge: Judge, falls: Sequence[Record]) -> Descent:
    correlations, clips, hits, own, ticks_judged = [], [], 0, 0, 0
    for record in falls:
        ticks = record.ticks
        if ticks is None:
            continue
        distance, region = judge(record, ticks)
        there = ticks.valid & ticks.tested
        lying = np.flatnonzero(ticks.labels == FALL)
        found = correlation(distance, int(lying[0]), there) if len(lying) else float("nan")
        if np.isfinite(found):
            correlations.append(found)
            clips.append(record.name)
        scored = there & (ticks.labels >= 0) & np.isfinite(region)
        hits += int((region[scored] == ticks.labels[scored]).sum())
        own += int((ticks.probabilities[scored, 0].argmax(axis=-1) == ticks.labels[scored]).sum())
        ticks_judged += int(scored.sum())
    values = np.array(correlations)
    return Descent(
        name,
        correlations,
        clips,
        float(np.median(values)) if len(values) else float("nan"),
        float(np.percentile(values, 10)) if len(values) else float("nan"),
        float((values >= 0.8).mean()) if len(values) else float("nan"),
        hits / ticks_judged if ticks_judged else float("nan"),
        own / ticks_judged if ticks_judged else float("nan"),
    )


def _shipped(predictions: Predictions) -> Judge:
    def judge(record: Record, ticks: Ticks) -> tuple[Values, Values]:
        plane = predictions.planes[record.part]
        scores = ticks.plane[:, 0] @ plane["weights"].T + plane["biases"]
        return ticks.distance[:, 0], np.where(ticks.valid, np.nan_to_num(scores).argmax(axis=1), np.nan)

    return judge


def _rival(name: str) -> Judge:
    def judge(record: Record, ticks: Ticks) -> tuple[Values, Values]:
        del record
        return ticks.planes[name][:, 0], ticks.planes[name][:, 1]

    return judge
