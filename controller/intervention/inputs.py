"""Watching one input: its newest good message, and how long nothing better may come."""

from __future__ import annotations

from typing import Generic, TypeVar

from bridge.clock import NS, nanoseconds
from bridge.inbox import Reading
from bridge.messages import Message

M = TypeVar("M", bound=Message)


class InputWatch(Generic[M]):
    """Keeps the newest good message of one input; what is wrong with the input counts once that is too old."""

    def __init__(self, name: str, age_limit_s: float) -> None:
        self._name = name
        self._age_limit_s = age_limit_s
        self.message: M | None = None
        self.stamp_ns = 0  # of `message`, on the reader's clock

    def take(self, now_ns: int, reading: Reading[M]) -> bool:
        """Take a reading; return whether it brought a new message."""
        if not reading.ok or reading.message is None:
            return False
        new = reading.message is not self.message
        self.message = reading.message
        self.stamp_ns = now_ns - nanoseconds(max(reading.age_s, 0.0))  # a sender's clock may run ahead of ours
        return new

    def fault(self, now_ns: int, reading: Reading[M]) -> str:
        """Return why the input must not be used at `now_ns`, or ''."""
        if self.message is None:
            return reading.fault or f"no {self._name} received yet"
        age_s = (now_ns - self.stamp_ns) / NS
        if age_s <= self._age_limit_s:
            return ""
        return reading.fault or f"{self._name} is {age_s * 1e3:.0f} ms old, limit {self._age_limit_s * 1e3:.0f}"
