"""How regularly a loop turns, how long things take, and how often something happens."""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

import numpy as np

from bridge.clock import NS

MINUTE: Final = 6000  # turns of a 100 Hz loop


class Percentiles(NamedTuple):
    """Median and 99th percentile of the newest values, and the largest there ever was; zeros before the first."""

    p50: float
    p99: float
    largest: float


class Spread:
    """Keeps the newest values of something in a ring that never grows."""

    def __init__(self, length: int = MINUTE) -> None:
        self._values = np.zeros(length)
        self._largest = 0.0
        self.count = 0

    def note(self, value: float) -> None:
        """Note one value, not negative."""
        self._values[self.count % len(self._values)] = value
        self.count += 1
        self._largest = max(self._largest, value)

    def percentiles(self) -> Percentiles:
        """Return where the values lie."""
        known = self._values[: min(self.count, len(self._values))]
        if not len(known):
            return Percentiles(0.0, 0.0, 0.0)
        p50, p99 = np.percentile(known, (50, 99)).tolist()
        return Percentiles(p50, p99, self._largest)

    def report(self, name: str) -> dict[str, str]:
        """Return the percentiles of spans in seconds, in milliseconds, as values of a status."""
        return {
            f"{name}_ms.{key}": f"{value * 1e3:.3f}"
            for key, value in zip(("p50", "p99", "max"), self.percentiles(), strict=True)
        }


class LoopTiming:
    """Keeps the newest periods of a loop: its rate, and how far each was from the one wanted."""

    def __init__(self, period_s: float, length: int = MINUTE) -> None:
        self._nominal_ns = period_s * NS
        self._starts_ns: deque[int] = deque(maxlen=min(length, round(10.0 / period_s)) + 1)
        self.error_s = Spread(length)  # |period - the one wanted|

    def tick(self, now_ns: int) -> None:
        """Note that a turn of the loop begins."""
        if self._starts_ns:
            self.error_s.note(abs(now_ns - self._starts_ns[-1] - self._nominal_ns) / NS)
        self._starts_ns.append(now_ns)

    def rate_hz(self) -> float:
        """Return the mean rate over the newest ten seconds [Hz]; 0 before the second turn."""
        if len(self._starts_ns) < 2 or self._starts_ns[-1] == self._starts_ns[0]:
            return 0.0
        return (len(self._starts_ns) - 1) * NS / (self._starts_ns[-1] - self._starts_ns[0])


class Schedule:
    """When the turns of a loop are due: at `start + k period` for ever, however late any of them comes.

    A turn that begins within its own period counts as that turn, late or not; turns whose whole period has gone
    by are missed: counted, and never made up for.
    """

    def __init__(self, start_ns: int, period_ns: int) -> None:
        self._period_ns = period_ns
        self.due_ns = start_ns  # of the next turn
        self.missed = 0

    def begin(self, now_ns: int) -> None:
        """Note that a turn begins at `now_ns`; `due_ns` is then when the one after it is due."""
        gone_by = max((now_ns - self.due_ns) // self._period_ns, 0)
        self.missed += gone_by
        self.due_ns += (gone_by + 1) * self._period_ns


class RecentRate:
    """Rate of something that happens now and then, over the newest two seconds."""

    SPAN_NS = 2 * NS

    def __init__(self) -> None:
        self._stamps_ns: deque[int] = deque(maxlen=1024)

    def note(self, now_ns: int) -> None:
        """Note that it happened."""
        self._stamps_ns.append(now_ns)

    def rate_hz(self, now_ns: int) -> float:
        """Return the rate [Hz]; 0 where it happened less than twice."""
        recent = [stamp for stamp in self._stamps_ns if now_ns - stamp < self.SPAN_NS]
        if len(recent) < 2 or recent[-1] == recent[0]:
            return 0.0
        return (len(recent) - 1) * NS / (recent[-1] - recent[0])
