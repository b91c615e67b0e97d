"""The reading end of a topic: inputs have an age and a validity, and what is wrong with them has a name."""

from __future__ import annotations

import logging
import threading
from collections import deque
from typing import Any, Generic, NamedTuple, TypeVar

from bridge.clock import NS
from bridge.codec import decode, prepare
from bridge.errors import InvalidMessage
from bridge.messages import Message
from bridge.refusals import FloodWatch, Refusals
from bridge.stuck import StuckWatch
from bridge.topics import Topic
from bridge.transport.interface import Sample, Transport

M = TypeVar("M", bound=Message)

_LOG = logging.getLogger("bridge.inbox")
_LOG.addHandler(logging.NullHandler())  # said where a process sets up a log; a replay in silence stays silent

FUTURE_TOLERANCE_S = 0.050  # clocks of two machines under NTP differ by less
_RIVAL_SAID_S = 1.0  # a second publisher is a warning for this long after it was last heard


class Reading(NamedTuple, Generic[M]):
    """What an inbox knows at one moment."""

    message: M | None  # newest message that was acceptable on arrival, kept for information even when stale
    age_s: float  # reader's now minus the message's stamp; inf without a message
    fault: str  # why the input must not be used, in words; '' means usable
    fresh: bool  # a new acceptable message since the last reading

    @property
    def ok(self) -> bool:
        """Whether the message may be used."""
        return self.fault == ""


class Inbox(Generic[M]):
    """Keeps the newest samples of one topic and judges them when asked.

    The transport's callback only stores bytes. Decoding and every check run in the
    reader's own loop: order by sequence number within one publisher, shape,
    finiteness and range by the message's `check`, age by the reader's clock.

    A stream has one publisher at a time. While the one that is followed lives, what another says is refused
    and its being there is said (`rival`); it takes over when the first has been silent for `max_age_s`.

    What is refused stands in the log with its reason and how often, and so does a flood; see `Refusals`.

    Args:
        transport: where to listen.
        topic: what to listen to.
        max_age_s: older is a fault [s]; None: what the topic table says.
        depth: how many samples to keep for `drain`.
        stuck_after_s: values that stay the same for longer under new stamps are a fault [s]; 0 = never.
    """

    def __init__(
        self,
        transport: Transport,
        topic: Topic,
        max_age_s: float | None = None,
        depth: int = 1,
        stuck_after_s: float = 0.0,
    ) -> None:
        prepare(topic)
        self.topic = topic
        self.max_age_s = topic.max_age_s if max_age_s is None else max_age_s
        self._stuck = StuckWatch(topic.key, stuck_after_s)
        # apart, so that nobody can crowd out the publisher that is followed
        self._waiting: deque[Sample] = deque(maxlen=depth)
        self._waiting_others: deque[Sample] = deque(maxlen=depth)
        self._arrived = threading.Event()
        self._message: M | None = None
        self._source: bytes | None = None  # None: nobody yet; b"" is a publisher that attaches no name
        self._sequence = -1
        self._stamp_ns = 0
        self._heard_ns = 0  # when the publisher that is followed was last heard, by the reader's clock
        self._rival_ns: int | None = None  # when another was
        self._fault = ""
        self.accepted = 0
        self.refused = 0
        self._refusals = Refusals(_LOG.warning)
        self._flood = FloodWatch(topic.key, topic.rate_hz)
        self._handle = transport.subscribe(topic, self._store)

    def _store(self, sample: Sample) -> None:
        self._flood.arrived += 1
        (self._waiting if sample.source == self._source else self._waiting_others).append(sample)
        self._arrived.set()

    def wait(self, timeout_s: float) -> bool:
        """Block until a sample is waiting; return whether one is."""
        return self._arrived.wait(timeout_s)

    def read(self, now_ns: int) -> Reading[M]:
        """Return the newest acceptable message with its age and what is wrong with the input now."""
        before = self.accepted
        for _ in self._take(now_ns):
            pass
        return self._reading(now_ns, fresh=self.accepted > before)

    def drain(self, now_ns: int) -> list[M]:
        """Return every well-formed message since the last call, in order.

        A message that declares itself invalid is among them, so that its reader can say why.
        """
        return list(self._take(now_ns))

    def rival(self, now_ns: int) -> str:
        """Return a warning while somebody else publishes this topic too, else ''."""
        if self._rival_ns is None or now_ns - self._rival_ns > _RIVAL_SAID_S * NS:
            return ""
        return f"two publishers of {self.topic.key}: the first is followed, the other refused"

    def close(self) -> None:
        """Stop listening."""
        self._handle.close()

    def _reading(self, now_ns: int, *, fresh: bool) -> Reading[M]:
        if self._message is None:
            return Reading(None, float("inf"), self._fault or f"no {self.topic.key} received yet", False)
        age_s = (now_ns - self._message.stamp_ns) / NS
        fault = self._fault
        if not fault and age_s > self.max_age_s:
            fault = f"{self.topic.key} is {age_s * 1e3:.0f} ms old, limit {self.max_age_s * 1e3:.0f}"
        return Reading(self._message, age_s, fault, fresh)

    def _take(self, now_ns: int) -> list[M]:
        self._arrived.clear()
        taken: list[M] = []
        if (flood := self._flood.judge(now_ns)) is not None:
            if flood:
                self._refusals.note(flood, now_ns / NS)
            self._refusals.sweep(now_ns / NS)  # once a second is cheap, and what has stopped is told too
        while sample := self._next():
            if self._is_rivals(sample):
                self._rival_ns = sample.arrival_ns
                self._refuse("from a second publisher while the first lives", now_ns)
                continue
            try:
                message = self._judge(sample, now_ns)
            except _OldSample as error:
                self._refuse(str(error), now_ns)
                continue
            except InvalidMessage as error:
                self._fault = str(error)
                self._refuse(self._fault, now_ns)
                continue
            taken.append(message)
        return taken

    def _refuse(self, why: str, now_ns: int) -> None:
        self.refused += 1
        self._refusals.note(f"{self.topic.key}: {why}", now_ns / NS)

    def _next(self) -> Sample | None:
        waiting = self._waiting or self._waiting_others
        return waiting.popleft() if waiting else None

    def _judge(self, sample: Sample, now_ns: int) -> M:
        message: Any = decode(self.topic, sample.payload, max(sample.sequence, 0))
        # a sample may arrive between the reader's `now` and this line, however late the reader got here
        ahead_s = (message.stamp_ns - max(now_ns, sample.arrival_ns)) / NS
        if ahead_s > FUTURE_TOLERANCE_S:
            limit_ms = FUTURE_TOLERANCE_S * 1e3
            raise InvalidMessage(f"{self.topic.key} is stamped {ahead_s * 1e3:.0f} ms ahead, limit {limit_ms:.0f}")
        if why := self._is_old(sample, message):
            raise _OldSample(why)
        try:
            message.check()
            self._stuck.judge(message)
        except InvalidMessage as error:
            declared = not getattr(message, "valid", True)
            if declared or sample.source == self._source:  # who sends nonsense is not one to follow from now on
                self._follow(sample, message)
            self._fault = str(error)
            if declared:
                return message  # type: ignore[no-any-return]
            raise
        self._follow(sample, message)
        self._message, self._fault = message, ""
        self.accepted += 1
        return message  # type: ignore[no-any-return]

    def _follow(self, sample: Sample, message: Message) -> None:
        self._source, self._sequence, self._stamp_ns = sample.source, sample.sequence, message.stamp_ns
        self._heard_ns = sample.arrival_ns

    def _is_old(self, sample: Sample, message: Message) -> str:
        """Say in what way something newer was taken already: by number within a publisher, by stamp across publishers.

        Streams that every role writes interleave freely, so there each publisher is judged alone. A number is
        held against a publisher no longer than `max_age_s`: one forged high number silences nobody for good.
        """
        if sample.source == self._source and sample.sequence >= 0:
            if sample.sequence > self._sequence:
                return ""
            if sample.arrival_ns - self._heard_ns <= self.max_age_s * NS:
                return f"number {sample.sequence} after {self._sequence}, an old message or a repeated one"
        if self.topic.publisher == "*" or message.stamp_ns > self._stamp_ns:
            return ""
        behind_ms = (self._stamp_ns - message.stamp_ns) / 1e6
        return f"stamped {behind_ms:.0f} ms before what was taken, an old message or a repeated one"

    def _is_rivals(self, sample: Sample) -> bool:
        """Whether another publisher sent it while the one that is followed lives; then it is not even read."""
        if sample.source == self._source or self._source is None or self.topic.publisher == "*":
            return False
        return sample.arrival_ns - self._heard_ns <= self.max_age_s * NS


class _OldSample(Exception):  # noqa: N818 (not an error: replaced by something newer)
    """The sample was overtaken."""
