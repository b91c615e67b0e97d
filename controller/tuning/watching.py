"""What `InputWatch` makes of a stream at every turn of the controller, for all turns at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.messages import Floats
from controller.tuning.cases import Ints, Stream


class Watched(NamedTuple):
    """One input over T turns."""

    newest: Ints  # (T,) last message that arrived, good or not; -1 before the first
    good: Ints  # (T,) newest good message that was taken; -1 before the first
    stamp_ns: Ints  # (T,) its stamp on the reader's clock
    faulty: NDArray[np.bool_]  # (T,) whether the input must not be used

    def fault(self, stream: Stream, turn: int, now_ns: int, limit_s: float) -> str:
        """Return why the input must not be used at a turn, in the words of the inbox."""
        if not self.faulty[turn]:
            return ""
        newest = int(self.newest[turn])
        if newest < 0:
            return f"no {stream.key} received yet"
        age_s = (now_ns - int(stream.stamp_ns[newest])) / NS
        return stream.faults[newest] or f"{stream.key} is {age_s * 1e3:.0f} ms old, limit {limit_s * 1e3:.0f}"


def watch(stream: Stream, times_ns: Ints, limit_s: float) -> Watched:
    """Return what is known of `stream` at `times_ns` (T,) when messages older than `limit_s` are lost.

    A turn reads the newest message alone, as an inbox of depth one does; a message that is not
    good, or too old when it is first seen, leaves the one before in use until that is too old.
    """
    newest = np.searchsorted(stream.arrival_ns, times_ns, side="right") - 1
    if not len(stream):
        nothing = np.full(len(times_ns), -1, np.int64)
        return Watched(nothing, nothing, np.zeros_like(nothing), np.ones(len(times_ns), np.bool_))
    usable = np.array([fault == "" for fault in stream.faults])
    age_s = (times_ns - stream.stamp_ns[newest]) / NS
    taken = (newest >= 0) & usable[newest] & (age_s <= limit_s)
    last = held(taken)
    known = last >= 0
    at = np.maximum(last, 0)
    good = np.where(known, newest[at], -1)
    # a sender's clock may run ahead of ours: what is stamped later than now counts as of now
    stamp_ns = np.where(known, np.minimum(stream.stamp_ns[newest[at]], times_ns[at]), 0)
    faulty = ~known | ((times_ns - stamp_ns) / NS > limit_s)
    return Watched(newest.astype(np.int64), good.astype(np.int64), stamp_ns.astype(np.int64), faulty)


def held(holds: NDArray[np.bool_]) -> Ints:
    """Return for each place the last one up to it where `holds`; -1 before the first."""
    places = np.where(holds, np.arange(len(holds), dtype=np.int64), -1)
    return np.maximum.accumulate(places) if len(places) else places


def values(felt_value: Floats, watched: Watched) -> Floats:
    """Return the newest good value at every turn, 0 before the first."""
    if not len(felt_value):
        return np.zeros(len(watched.good))
    return np.where(watched.good >= 0, felt_value[np.maximum(watched.good, 0)], 0.0)
