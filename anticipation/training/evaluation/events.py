"""Falls foreseen in time, and interventions where nobody falls: from what the whole system did, frame by frame.

An alarm is what the intervention made of a horizon: the supervisor in GUARD (stiffening begins) or ARREST. So
thresholds, dwell and quality of `[intervention]`, `[supervisor]` and `[anticipation]` are part of every number here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, chi2

from anticipation.training.clips import FALL
from anticipation.training.evaluation.onset import dataset_onset, physical_onset
from anticipation.training.evaluation.records import Frames, Record
from anticipation.training.mocap import WALKS
from bridge.clock import NS
from bridge.messages import GaitState

GUARDED: Final = (GaitState.GUARD.value, GaitState.ARREST.value)
STIFF: Final = (*GUARDED, GaitState.RECOVER.value)  # one intervention lasts until all of this is over
CONFIDENCE: Final = 0.95


class Fall(NamedTuple):
    """One fall. Leads are times before the first lying frame [s]; NaN where there was no such alarm."""

    name: str
    source: str
    part: int
    onset: float  # of the data set [s before lying]
    physical_onset: float  # found from the motion [s before lying]; NaN where it cannot be seen
    first_alarm: float  # GUARD or ARREST [s before lying]; negative: after it
    first_arrest: float  # ARREST alone
    early: bool  # an alarm before the data set's onset
    early_physical: bool  # an alarm before the physical onset

    @property
    def foreseen(self) -> bool:
        """An alarm before the first lying frame, and none before the data set's onset."""
        return self.first_alarm > 0 and not self.early


def fall_of(record: Record) -> Fall | None:
    """Return what happened in a clip of a fall; None if nobody lies in it or the system was not run over it."""
    frames = record.frames
    if frames is None or not (frames.labels == FALL).any():
        return None
    lying_ns = int(frames.stamps_ns[np.flatnonzero(frames.labels == FALL)[0]])
    onset = dataset_onset(frames.labels)
    assert onset is not None
    onset_ns = int(frames.stamps_ns[onset])
    seen_ns = _physical_ns(record)
    alarm_ns, arrest_ns = _first(frames, GUARDED), _first(frames, (GaitState.ARREST.value,))
    return Fall(
        name=record.name,
        source=record.source,
        part=record.part,
        onset=(lying_ns - onset_ns) / NS,
        physical_onset=float("nan") if seen_ns is None else (lying_ns - seen_ns) / NS,
        first_alarm=float("nan") if alarm_ns is None else (lying_ns - alarm_ns) / NS,
        first_arrest=float("nan") if arrest_ns is None else (lying_ns - arrest_ns) / NS,
        early=alarm_ns is not None and alarm_ns < onset_ns,
        early_physical=alarm_ns is not None and seen_ns is not None and alarm_ns < seen_ns,
    )


def _physical_ns(record: Record) -> int | None:
    if record.ticks is None:
        return None
    onset = physical_onset(record.ticks)
    return None if onset is None else int(record.ticks.stamps_ns[onset])


def _first(frames: Frames, states: Sequence[str]) -> int | None:
    there = np.flatnonzero(np.isin(frames.state, states))
    return int(frames.stamps_ns[there[0]]) if len(there) else None


class Foreseen(NamedTuple):
    """Falls together; leads [s] over the falls that were foreseen."""

    falls: int
    foreseen: int
    early: int
    early_physical: int
    late: int  # no alarm before the first lying frame
    share: float
    share_interval: tuple[float, float]
    median_lead: float
    fifth_percentile_lead: float


def together(falls: Sequence[Fall]) -> Foreseen:
    """Count falls foreseen."""
    leads = [fall.first_alarm for fall in falls if fall.foreseen]
    foreseen = len(leads)
    return Foreseen(
        falls=len(falls),
        foreseen=foreseen,
        early=sum(fall.early for fall in falls),
        early_physical=sum(fall.early_physical for fall in falls),
        late=sum(not fall.first_alarm > 0 for fall in falls),
        share=foreseen / len(falls) if falls else float("nan"),
        share_interval=share_interval(foreseen, len(falls)),
        median_lead=float(np.median(leads)) if leads else float("nan"),
        fifth_percentile_lead=float(np.percentile(leads, 5)) if leads else float("nan"),
    )


def share_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return the exact interval of a share at 95 % (Clopper and Pearson, Biometrika 26, 1934)."""
    if not trials:
        return (0.0, 1.0)
    tail = (1.0 - CONFIDENCE) / 2
    low = float(beta.ppf(tail, hits, trials - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - tail, hits + 1, trials - hits)) if hits < trials else 1.0
    return low, high


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Return the exact interval of a Poisson rate at 95 % [1/h] (Garwood, Biometrika 28, 1936)."""
    tail = (1.0 - CONFIDENCE) / 2
    low = float(chi2.ppf(tail, 2 * count)) / 2 if count else 0.0
    high = float(chi2.ppf(1.0 - tail, 2 * count + 2)) / 2
    return (low / hours, high / hours) if hours > 0 else (0.0, float("inf"))


class Calm(NamedTuple):
    """Clips of one activity in which nobody falls."""

    activity: str
    clips: int
    hours: float
    clips_with_any: int  # GUARD or ARREST
    clips_with_arrest: int
    interventions: int  # GUARD or ARREST, counted once until the walker is free again
    per_hour: float
    interval: tuple[float, float]  # 95 % [1/h]
    clips_stopped: int  # SAFE_STOP: nobody to be seen, which is no intervention but no walking either
    frames: int  # with a horizon
    frames_above: int  # of these, p(fall in 500 ms) above one half, before any dwell


_UPFALL: Final = {
    "activity06": "UP-Fall walking",
    "activity07": "UP-Fall standing",
    "activity08": "UP-Fall sitting",
    "activity09": "UP-Fall picking up",
    "activity10": "UP-Fall jumping",
    "activity11": "UP-Fall lying down on purpose",
}


def activity_of(record: Record) -> str:
    """Say what a clip without a fall shows."""
    if record.kind == "partial":
        return "URFD daily, eight keypoints"
    if record.kind == "walk":
        walks = record.source == "cmu" or record.name.split("_")[1].startswith(WALKS)
        return "mocap gait" if walks else "mocap other motion"
    return _UPFALL.get(record.name[:10], "URFD adl-40, lying down on purpose")


def calm(records: Sequence[Record]) -> list[Calm]:
    """Count interventions by activity, in the order of the first clip of each."""
    by_activity: dict[str, list[Frames]] = {}
    for record in records:
        if record.frames is not None and record.kind in {"daily", "partial", "walk"}:
            by_activity.setdefault(activity_of(record), []).append(record.frames)
    return [counted(name, frames) for name, frames in by_activity.items()]


def counted(activity: str, clips: Sequence[Frames]) -> Calm:
    """Count the interventions in some clips."""
    hours = sum(_hours(frames) for frames in clips)
    count = sum(interventions(frames.state) for frames in clips)
    return Calm(
        activity=activity,
        clips=len(clips),
        hours=hours,
        clips_with_any=sum(bool(np.isin(frames.state, GUARDED).any()) for frames in clips),
        clips_with_arrest=sum(bool((frames.state == GaitState.ARREST.value).any()) for frames in clips),
        interventions=count,
        per_hour=count / hours if hours else float("nan"),
        interval=rate_interval(count, hours),
        clips_stopped=sum(bool((frames.state == GaitState.SAFE_STOP.value).any()) for frames in clips),
        frames=sum(int(np.isfinite(frames.probabilities[:, -1, FALL]).sum()) for frames in clips),
        frames_above=sum(int((frames.probabilities[:, -1, FALL] > 0.5).sum()) for frames in clips),
    )


def interventions(state: NDArray[np.str_]) -> int:
    """Count interventions in a run of states (N,): each lasts until neither GUARD, ARREST nor RECOVER is left."""
    guarded, stiff = np.isin(state, GUARDED), np.isin(state, STIFF)
    count, within = 0, False
    for now, still in zip(guarded, stiff, strict=True):
        count += bool(now and not within)
        within = bool(still and (within or now))
    return count


def _hours(frames: Frames) -> float:
    count = len(frames.stamps_ns)
    if count < 2:
        return 0.0
    step_ns = (int(frames.stamps_ns[-1]) - int(frames.stamps_ns[0])) / (count - 1)
    return count * step_ns / NS / 3600.0
