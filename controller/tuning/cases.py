"""A case: what the controller was given in one recording, and where in it somebody fell.

Nothing in a case depends on the thresholds of `[intervention]`, so it is made once and replayed as often as one likes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.messages import STEPS, FallHorizon, Floats

Ints = NDArray[np.int64]

OPEN: Final = float("inf")  # a fall that is not over before the recording is


class Fall(NamedTuple):
    """Somebody falls; times from the case's start [s]."""

    onset_s: float  # balance is lost
    impact_s: float  # lying, or on the floor: an intervention is in time before this
    over_s: float = OPEN  # up again, or helped up: from here on an intervention is needless again


@dataclass(frozen=True, slots=True)
class Stream:
    """Messages of one input in order of arrival; what an inbox would refuse carries the reason."""

    key: str  # of the topic, as faults name it
    arrival_ns: Ints  # (M,) ascending
    stamp_ns: Ints  # (M,)
    faults: tuple[str, ...]  # (M,) why the message must not be used, '' when it may be

    def __len__(self) -> int:
        return len(self.arrival_ns)


@dataclass(frozen=True, slots=True)
class Horizons:
    """Fall-state horizons; values of unusable ones are never looked at."""

    stream: Stream
    probabilities: Floats  # (M, 16, 3) stable, transient, fall
    distance: Floats  # (M, 16) [within-class sd], positive outside the fall boundary
    distance_rate: Floats  # (M, 16) [1/s]
    quality: Floats  # (M,) 0..1
    step_s: Floats  # (M,) [s]

    def message(self, index: int) -> FallHorizon:
        """Return a horizon as a message, without what no threshold looks at."""
        nothing = np.zeros((STEPS, 12, 2))
        return FallHorizon(
            stamp_ns=int(self.stream.stamp_ns[index]),
            probabilities=self.probabilities[index],
            distance=self.distance[index],
            distance_rate=self.distance_rate[index],
            time_to_boundary=np.full(STEPS, np.inf),
            centre_distance=nothing[:, :3, 0],
            plane=nothing[:, 0],
            forecast_px=nothing,
            quality=float(self.quality[index]),
            step_s=float(self.step_s[index]),
        )


@dataclass(frozen=True, slots=True)
class Felt:
    """The one number that the intervention reads of wrench or odometry."""

    stream: Stream
    value: Floats  # (M,) downward pull at the interface [N], or downward speed of the column [m/s]


@dataclass(frozen=True, slots=True)
class Case:
    """One recording as the controller's turns see it."""

    name: str  # such as 'falls.npz:fall-01/alphapose' or 'walk.mcap'
    group: str  # what was recorded together and must not be split between choosing and judging
    start_ns: int  # of the recording, and of the first turn
    period_ns: int  # of the controller
    ticks: int  # T, turns
    horizons: Horizons
    pull: Felt | None = None  # None: a healthy walker that nobody pulls at
    descent: Felt | None = None  # None: a column at rest
    falls: tuple[Fall, ...] = ()  # in order
    labelled: bool = True  # False: nobody said whether somebody falls; taken as without

    @property
    def duration_s(self) -> float:
        """Length of the case [s]."""
        return self.ticks * self.period_ns / NS

    @property
    def times_ns(self) -> Ints:
        """When the controller has its turns, (T,) [ns]."""
        return self.start_ns + self.period_ns * np.arange(self.ticks, dtype=np.int64)

    @property
    def times_s(self) -> Floats:
        """When the controller has its turns, (T,) [s] from the start."""
        times_s: Floats = np.arange(self.ticks, dtype=np.float64) * (self.period_ns / NS)
        return times_s


class HorizonColumns:
    """Gathers horizons one by one, and nothing of them that no threshold looks at."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._rows: list[tuple[int, int, str, float, float]] = []
        self._arrays: list[tuple[Floats, Floats, Floats]] = []

    def add(self, message: FallHorizon, arrival_ns: int, fault: str) -> None:
        """Take the next horizon."""
        self._rows.append((arrival_ns, message.stamp_ns, fault, message.quality, message.step_s))
        self._arrays.append((message.probabilities, message.distance, message.distance_rate))

    def horizons(self) -> Horizons:
        """Return what was gathered."""
        count = len(self._rows)
        arrival_ns, stamp_ns, faults, quality, step_s = zip(*self._rows, strict=True) if count else ((),) * 5
        return Horizons(
            stream(self._key, arrival_ns, stamp_ns, faults),
            np.array([arrays[0] for arrays in self._arrays]).reshape(count, STEPS, 3),
            np.array([arrays[1] for arrays in self._arrays]).reshape(count, STEPS),
            np.array([arrays[2] for arrays in self._arrays]).reshape(count, STEPS),
            np.array(quality, dtype=np.float64),
            np.array(step_s, dtype=np.float64),
        )


def stream(key: str, arrival_ns: Sequence[int], stamp_ns: Sequence[int], faults: Sequence[str]) -> Stream:
    """Return a stream of plain sequences."""
    return Stream(key, np.array(arrival_ns, np.int64), np.array(stamp_ns, np.int64), tuple(faults))
