"""When balance was lost, found from the motion itself: a second annotation of onset beside the data set's.

Two signals of the cleaned keypoints, at 30 Hz: the speed at which the upper-body centre descends through the image
[body lengths/s] and the speed at which the trunk tips away from the image vertical [rad/s]. Each has a range that the
person keeps to while nothing happens: as in a control chart, three standard deviations about the middle of their own
motion so far (Hu and Qu, "An individual-specific fall detection model based on the statistical process control chart",
Safety Science 64, 2014; trunk angle and its rate as signals: Liu and Lockhart, IEEE Trans. Biomed. Eng. 61, 2014). The
*physical onset* is where the stretch out of that range begins that leads to the fastest descent: from there on the
body goes down or over, without a pause, faster than this person moves.

That is the start of the descent, not yet the loss of balance that precedes it: whoever topples like a pendulum hardly
moves at first. On generated falls, whose loss of balance is known, it comes 0.2 to 0.6 s later and 0.4 to 0.8 s before
the ground; in real falls Choi et al. (J. Biomechanics 48, 2015) saw 583 +- 255 ms from the start of the descent to the
impact. The image's vertical stands for gravity's.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Labels
from anticipation.training.evaluation.records import Record, Ticks
from bridge.messages import STEP_S, Floats

SMOOTHED: Final = 7  # ticks of the polynomial that gives the speeds
DEVIATIONS: Final = 3.0  # of the person's own motion: the limits of a control chart
SPREAD: Final = 1.4826  # from median absolute deviation to standard deviation
DESCENT: Final = 0.25  # least limit on descending [body lengths/s]: a walker's trunk reaches about 0.2
TIPPING: Final = np.radians(30.0)  # least limit on tipping [rad/s]: a walker's trunk reaches about half of it
LULL: Final = 3  # ticks inside the range that do not end a stretch
BEFORE: Final = 75  # ticks before lying in which the fastest descent is sought
APART: Final = 15  # ticks next to the fastest descent that say nothing of the person's usual motion
FEWEST: Final = 10  # ticks that make a range


def physical_onset(ticks: Ticks) -> int | None:
    """Return the tick at which the fall begins that ends with the first lying tick; None if it cannot be seen."""
    lying = np.flatnonzero(ticks.labels == FALL)
    if not len(lying):
        return None
    end = int(lying[0])
    start = max(0, end - BEFORE)
    descent = descent_speed(ticks)
    if end - start < SMOOTHED or not np.isfinite(descent[start : end + 1]).any():
        return None
    fastest = start + int(np.nanargmax(descent[start : end + 1]))
    begun = [
        _run_start(speed, fastest, _limit(speed, fastest, least))
        for speed, least in ((descent, DESCENT), (tipping_speed(ticks), TIPPING))
    ]
    found = [each for each in begun if each is not None]
    return min(found) if found else None


def physical_labels(record: Record) -> Labels:
    """Return labels with 'transient' from the physical onset to the first lying tick.

    Clips without a fall keep their labels; a fall whose onset cannot be seen carries none before it lies.
    """
    ticks = record.ticks
    assert ticks is not None
    lying = np.flatnonzero(ticks.labels == FALL)
    if not len(lying):
        return ticks.labels
    labels = ticks.labels.copy()
    onset = physical_onset(ticks)
    end = int(lying[0])
    if onset is None:
        labels[:end] = UNLABELLED
    else:
        labels[:onset] = STABLE
        labels[onset:end] = TRANSIENT
    return labels


def dataset_onset(labels: Labels) -> int | None:
    """Return the first tick that the data set does not call stable before the first that it calls a fall."""
    lying = np.flatnonzero(labels == FALL)
    if not len(lying):
        return None
    before = np.flatnonzero(labels[: lying[0]] == STABLE)
    return int(before[-1]) + 1 if len(before) else 0


def descent_speed(ticks: Ticks) -> Floats:
    """Speed of the upper-body centre down the image, (T,) [body lengths/s]."""
    return _rate(ticks.centre_px[:, 1].astype(np.float64)) / ticks.body_px


def tipping_speed(ticks: Ticks) -> Floats:
    """Speed at which the trunk leaves the image vertical, (T,) [rad/s]."""
    trunk = ticks.poses[:, 0:2].mean(axis=1) - ticks.poses[:, 6:8].mean(axis=1)
    return _rate(np.abs(np.arctan2(trunk[:, 0], -trunk[:, 1]).astype(np.float64)))


def _rate(values: Floats) -> Floats:
    """Derivative (T,) [1/s] by a sliding parabola (Savitzky and Golay 1964); NaN in gaps, which a line bridges."""
    there = np.isfinite(values)
    if there.sum() < SMOOTHED:
        return np.full(len(values), np.nan)
    at = np.arange(len(values))
    bridged = np.interp(at, at[there], values[there])
    rate: Floats = savgol_filter(bridged, SMOOTHED, 2, deriv=1, delta=STEP_S)
    return np.where(there, rate, np.nan)


def _limit(speed: Floats, fastest: int, least: float) -> float:
    """Upper end of the person's usual range, from what came well before the fastest descent."""
    usual = speed[: max(0, fastest - APART)]
    usual = usual[np.isfinite(usual)]
    if len(usual) < FEWEST:
        return least
    middle = float(np.median(usual))
    return max(least, middle + DEVIATIONS * SPREAD * float(np.median(np.abs(usual - middle))))


def _run_start(speed: Floats, fastest: int, limit: float) -> int | None:
    """Return where the stretch beyond the limit begins that reaches the fastest descent; None if there is none."""
    beyond = np.nan_to_num(speed, nan=-np.inf) > limit
    recent = np.flatnonzero(beyond[max(0, fastest - LULL) : fastest + 1])
    if not len(recent):
        return None
    at = max(0, fastest - LULL) + int(recent[-1])
    start = at
    for tick in range(at, -1, -1):
        if beyond[tick]:
            start = tick
        elif start - tick > LULL:
            break
    return start
