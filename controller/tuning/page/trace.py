"""What a timeline shows of one recording: a few curves, thin enough to be sent at every move of a slider."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.messages import Floats

MOST_POINTS: Final = 1500  # of one curve: more than a screen has columns


class Band(NamedTuple):
    """A state and how long it lasted."""

    start_s: float
    end_s: float
    state: str


def bands(time_s: Floats, state: np.ndarray) -> list[Band]:
    """Return the stretches of equal state of `state` (N,), text, at `time_s` (N,); each ends where the next begins."""
    if not len(time_s):
        return []
    begins = np.flatnonzero(np.append(True, state[1:] != state[:-1]))
    ends = [*begins[1:], len(time_s) - 1]
    return [Band(float(time_s[a]), float(time_s[b]), str(state[a])) for a, b in zip(begins, ends, strict=True)]


def thin(time_s: Floats, value: Floats, most: int = MOST_POINTS) -> list[list[float | None]]:
    """Return [time, value] pairs of a curve, at most `most` and a few, NaN as None.

    Of each of the equal stretches of a longer one the least and the largest value stay, in their order: a spike of
    one frame is still seen. A stretch in which nothing is known stays a gap.
    """
    if len(time_s) > most:
        keep = _extremes(value, most // 2)
        time_s, value = time_s[keep], value[keep]
    return [
        [round(t, 3), round(v, 4) if math.isfinite(v) else None]
        for t, v in zip(time_s.tolist(), value.tolist(), strict=True)
    ]


def _extremes(value: Floats, stretches: int) -> NDArray[np.int64]:
    """Return, ascending, where each stretch of `value` (N,) has its least and its largest known value."""
    length = -(-len(value) // stretches)
    padded = np.full(stretches * length, np.nan)
    padded[: len(value)] = value
    rows = padded.reshape(stretches, length)
    known = np.isfinite(rows)
    least = np.where(known, rows, np.inf).argmin(axis=1)
    largest = np.where(known, rows, -np.inf).argmax(axis=1)
    places = np.stack([least, largest], axis=1) + length * np.arange(stretches)[:, None]
    return np.unique(places[places < len(value)])
