"""How regularly a loop turns, and how often something happens."""

from __future__ import annotations

from collections import deque

import numpy as np

from bridge.clock import NS


class LoopTiming:
    """Keeps the newest periods of a loop in a ring that never grows."""

    def __init__(self, period_s: float, length: int = 1000) -> None:
        self._nominal_ns = period_s * 1e9
        self._periods_ns = np.zeros(length, dtype=np.int64)
        self._count = 0
        self._last_ns: int | None = None
        self.missed = 0  # periods longer than one and a half

    def tick(self, now_ns: int) -> None:
        """Note that a turn of the loop begins."""
        if self._last_ns is not None:
            period_ns = now_ns - self._last_ns
            self._periods_ns[self._count % len(self._periods_ns)] = period_ns
            self._count += 1
            self.missed += period_ns > 1.5 * self._nominal_ns
        self._last_ns = now_ns

    def rate_hz(self) -> float:
        """Return the mean rate over the ring [Hz]; 0 before the second turn."""
        total_ns = float(self._periods_ns.sum())
        return min(self._count, len(self._periods_ns)) * 1e9 / total_ns if total_ns > 0.0 else 0.0

    def period_p99_s(self) -> float:
        """Return the 99th percentile of the periods in the ring [s]; 0 before the second turn."""
        known = self._periods_ns[: min(self._count, len(self._periods_ns))]
        return float(np.percentile(known, 99)) / 1e9 if len(known) else 0.0


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
