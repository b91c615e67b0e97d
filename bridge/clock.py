"""Time as the nodes see it: injected, so that tests and replays own it."""

from __future__ import annotations

import time
from typing import Protocol

NS = 1_000_000_000


def seconds(nanoseconds: int) -> float:
    """Convert a span in integer nanoseconds to seconds."""
    return nanoseconds / NS


def nanoseconds(seconds: float) -> int:
    """Convert a span in seconds to the nearest integer nanosecond."""
    return round(seconds * NS)


class Clock(Protocol):
    """A clock that counts nanoseconds since the Unix epoch and never steps."""

    def now_ns(self) -> int:
        """Return the time now [ns since the epoch]."""
        ...

    def sleep_until(self, when_ns: int) -> None:
        """Return at `when_ns` or as soon after as the machine allows."""
        ...


class SystemClock:
    """Wall time read once, then carried by the monotonic clock.

    Stamps stay comparable between processes, and stepping the wall clock while
    a node runs (NTP, an operator) cannot make inputs look fresh or stale.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the time now [ns since the epoch]."""
        return time.monotonic_ns() + self._offset_ns

    def sleep_until(self, when_ns: int) -> None:
        """Sleep until `when_ns`; return at once if it has passed."""
        left = when_ns - self.now_ns()
        if left > 0:
            time.sleep(left / NS)


class ManualClock:
    """A clock that moves only when told to."""

    def __init__(self, now_ns: int = NS) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Return the time last set [ns]."""
        return self._now_ns

    def sleep_until(self, when_ns: int) -> None:
        """Jump to `when_ns` unless it has passed."""
        self._now_ns = max(self._now_ns, when_ns)

    def advance(self, span_s: float) -> int:
        """Move forward by `span_s` seconds and return the new time [ns]."""
        self._now_ns += nanoseconds(span_s)
        return self._now_ns
