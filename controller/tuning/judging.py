"""Which recorded messages an inbox would have taken, which it would have refused, and why."""

from __future__ import annotations

from typing import Any, NamedTuple

from bridge.clock import NS
from bridge.codec import decode
from bridge.errors import InvalidMessage
from bridge.messages import Message
from bridge.stuck import StuckWatch
from bridge.topics import Topic

FUTURE_S = 0.050  # as the inbox tolerates it


class Judged(NamedTuple):
    """One message with what an inbox says of it."""

    message: Message
    arrival_ns: int
    fault: str  # '' when it may be used


class Judge:
    """Judges one stream in order of arrival, as `bridge.inbox.Inbox` does.

    Left out are messages that an inbox passes over in silence: repeated or overtaken ones, and a second publisher
    while the first lives. What cannot be decoded has no stamp and is left out too.
    """

    def __init__(self, topic: Topic, stuck_after_s: float) -> None:
        self._topic = topic
        self._stuck = StuckWatch(topic.key, stuck_after_s)
        self._source: bytes | None = None
        self._sequence, self._stamp_ns, self._heard_ns = -1, 0, 0

    def judge(self, sample: Any) -> Judged | None:
        """Return what an inbox says of the next `bridge.transport.interface.Sample`; None if it says nothing."""
        lapsed = sample.arrival_ns - self._heard_ns > self._topic.max_age_s * NS
        if self._source is not None and sample.source != self._source and not lapsed:
            return None
        try:
            message = decode(self._topic, sample.payload, max(sample.sequence, 0))
        except InvalidMessage:
            return None
        ahead_s = (message.stamp_ns - sample.arrival_ns) / NS
        if ahead_s > FUTURE_S:
            words = f"{self._topic.key} is stamped {ahead_s * 1e3:.0f} ms ahead, limit {FUTURE_S * 1e3:.0f}"
            return Judged(message, sample.arrival_ns, words)
        if self._is_old(sample, message.stamp_ns, lapsed=lapsed):
            return None
        fault = ""
        try:
            message.check()
            self._stuck.judge(message)
        except InvalidMessage as error:
            fault = str(error)
        if not fault or sample.source == self._source or not getattr(message, "valid", True):
            self._source, self._sequence = sample.source, sample.sequence
            self._stamp_ns, self._heard_ns = message.stamp_ns, sample.arrival_ns
        return Judged(message, sample.arrival_ns, fault)

    def _is_old(self, sample: Any, stamp_ns: int, *, lapsed: bool) -> bool:
        """Whether something newer was taken already: by number within a publisher, by stamp after its silence."""
        if sample.source == self._source and sample.sequence >= 0:
            if sample.sequence > self._sequence:
                return False
            if not lapsed:
                return True
        return stamp_ns <= self._stamp_ns
