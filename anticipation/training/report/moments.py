"""Which moment of which held-out fall a picture shows: never the best one, always the typical one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anticipation.motion import HORIZON
from anticipation.training.clips import FALL
from anticipation.training.evaluation.records import Record, Ticks
from bridge.messages import STEPS

STANDING_TICKS = 75  # before lying: two and a half seconds, nothing has happened yet


class Moment(NamedTuple):
    """A tick of a clip whose next half second is known."""

    record: Record
    ticks: Ticks
    present: int
    lying: int  # first tick of lying
    error: float  # of the keypoints foreseen half a second ahead [body lengths]


def typical(records: Sequence[Record], before_lying: int) -> Moment | None:
    """Return the fall with the median error at a number of ticks before lying; None if none can be judged."""
    moments = [each for record in records if (each := _moment(record, before_lying)) is not None]
    return sorted(moments, key=lambda each: each.error)[len(moments) // 2] if moments else None


def _moment(record: Record, before_lying: int) -> Moment | None:
    ticks = record.ticks
    if ticks is None or not (ticks.labels == FALL).any():
        return None
    lying = int(np.flatnonzero(ticks.labels == FALL)[0])
    present = lying - before_lying
    end = present + HORIZON
    if present < 0 or end >= len(ticks) or not ticks.valid[present] or not ticks.tested[present]:
        return None
    if not ticks.whole[present : end + 1].all():
        return None
    away = np.linalg.norm(ticks.forecast[present, -1].astype(np.float64) - ticks.poses[end], axis=-1)
    return Moment(record, ticks, present, lying, float(away.mean()))


def half_a_second_before(records: Sequence[Record]) -> Moment | None:
    """Return the typical fall, half a second before lying."""
    return typical(records, STEPS - 1)


def well_before(records: Sequence[Record]) -> Moment | None:
    """Return the typical person of whom nothing is to be seen yet, as long before lying as there are examples."""
    for ticks in range(STANDING_TICKS, 2 * STEPS, -5):
        found = typical(records, ticks)
        if found is not None:
            return found
    return None
