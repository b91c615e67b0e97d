"""What can go wrong with a stream between its publisher and its reader, sample by sample."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.clock import NS, nanoseconds
from bridge.codec import decode, encode
from bridge.messages import FallHorizon, Keypoints, Odometry, SupportCommand, Wrench
from bridge.topics import Topic

_STAMP: Final = struct.Struct("<iI")  # every message here begins with a std_msgs/Header, after 4 bytes of CDR
_STAMP_AT: Final = 4
_ATTACHMENT: Final = struct.Struct("<qqB16s")  # as `bridge.transport` attaches it: number, stamp, length, publisher


class Carried(NamedTuple):
    """A sample on its way through the relay."""

    payload: bytes
    attachment: bytes
    good: bool = True  # as its publisher sent it
    delay_ns: int = 0  # to hold it back for

    @property
    def stamp_ns(self) -> int:
        """Stamp in the message's header [ns]."""
        sec, nanosec = _STAMP.unpack_from(self.payload, _STAMP_AT)
        return int(sec) * NS + int(nanosec)

    def stamped(self, stamp_ns: int) -> Carried:
        """Return a copy that says it was stamped at `stamp_ns`, in the header and in the attachment."""
        payload = bytearray(self.payload)
        _STAMP.pack_into(payload, _STAMP_AT, stamp_ns // NS, stamp_ns % NS)
        number, _, length, source = _ATTACHMENT.unpack(self.attachment)
        return self._replace(
            payload=bytes(payload), attachment=_ATTACHMENT.pack(number, stamp_ns, length, source), good=False
        )


class Passage:
    """What one fault does to one stream while it lasts.

    Args:
        topic: the stream.
        last: newest sample that passed before the fault.
    """

    def __init__(self, topic: Topic, last: Carried | None) -> None:
        self.topic, self.last = topic, last
        self.began_ns: int | None = None
        self.count = 0

    def take(self, sample: Carried, now_ns: int) -> Carried | None:
        """Return what the reader gets instead of `sample`; None for nothing."""
        if self.began_ns is None:
            self.began_ns = now_ns
        self.count += 1
        return self.change(sample, now_ns - self.began_ns)

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        """Return what becomes of `sample`, `elapsed_ns` after the fault began."""
        raise NotImplementedError


class Off(Passage):
    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return None


class Stuck(Passage):
    """The last sample again and again, with its old stamp and number."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return None if self.last is None else self.last._replace(good=False)


class Frozen(Passage):
    """The values of the last sample under new stamps and numbers: the publisher lives, what it measures does not."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        if self.last is None:
            return None
        number = _ATTACHMENT.unpack(sample.attachment)[0]
        message: Any = replace(decode(self.topic, self.last.payload, number), stamp_ns=sample.stamp_ns, sequence=number)
        return sample._replace(payload=encode(self.topic, message), good=False)


class Garbage(Passage):
    """Random bytes of the same length; every second time behind a good head, so that they are read to the end."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        head = sample.payload[: 4 if self.count % 2 else 0]
        noise = head + random.Random(self.count).randbytes(len(sample.payload) - len(head))  # the same in every run
        return sample._replace(payload=noise, good=False)


class WrongValue(Passage):
    """Well-formed messages that say what cannot be: not a number and far out of range, in turn."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        bad = np.nan if self.count % 2 else 1e6
        message: Any = decode(self.topic, sample.payload, _ATTACHMENT.unpack(sample.attachment)[0])
        return sample._replace(payload=encode(self.topic, _SPOIL[type(message)](message, bad)), good=False)


def _spoil_keypoints(m: Keypoints, bad: float) -> Keypoints:
    return replace(m, position_px=np.full((12, 2), bad), status=np.zeros(12, dtype=np.uint8))


def _spoil_horizon(m: FallHorizon, bad: float) -> FallHorizon:
    return replace(m, probabilities=np.full((16, 3), bad))


def _spoil_wrench(m: Wrench, bad: float) -> Wrench:
    return replace(m, force=np.array([bad, 0.0, 0.0]))


def _spoil_odometry(m: Odometry, bad: float) -> Odometry:
    return replace(m, velocity=np.array([bad, 0.0, 0.0]))


def _spoil_command(m: SupportCommand, bad: float) -> SupportCommand:
    return replace(m, velocity=np.array([bad, 0.0, 0.0, 0.0]))


_SPOIL: Final[dict[type, Callable[[Any, float], Any]]] = {
    Keypoints: _spoil_keypoints,
    FallHorizon: _spoil_horizon,
    Wrench: _spoil_wrench,
    Odometry: _spoil_odometry,
    SupportCommand: _spoil_command,
}


class Slow(Passage):
    """One sample in twice the allowed age."""

    ages = 2.0

    def __init__(self, topic: Topic, last: Carried | None) -> None:
        super().__init__(topic, last)
        self._next_ns = nanoseconds(self.ages * topic.max_age_s)

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        if elapsed_ns < self._next_ns:
            return None
        self._next_ns += nanoseconds(self.ages * self.topic.max_age_s)
        return sample


class HalfRate(Passage):
    """Every second sample; within the allowed age."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return sample if self.count % 2 else None


class Delayed(Passage):
    """Every sample half as old again as is allowed when it arrives."""

    ages = 1.5

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return sample._replace(delay_ns=nanoseconds(self.ages * self.topic.max_age_s), good=self.ages < 1.0)


class Late(Delayed):
    """Every sample later than usual by a quarter of what is allowed."""

    ages = 0.25


class Intermittent(Passage):
    """Twice the allowed age of silence, then as much of samples, and again."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        silent = int(elapsed_ns / nanoseconds(2.0 * self.topic.max_age_s)) % 2 == 0
        return None if silent else sample


class Lossy(Passage):
    """Every third sample is lost."""

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return None if self.count % 3 == 0 else sample


class ClockAhead(Passage):
    """The publisher's clock jumps 5 s ahead."""

    jump_s = 5.0

    def change(self, sample: Carried, elapsed_ns: int) -> Carried | None:
        return sample.stamped(sample.stamp_ns + nanoseconds(self.jump_s))


class ClockBehind(ClockAhead):
    """The publisher's clock jumps 5 s back."""

    jump_s = -5.0


@dataclass(frozen=True)
class StreamFault:
    """A fault and what the system is to make of it."""

    name: str
    passage: type[Passage]
    what: str  # for the table's legend
    stops: bool = True  # whether the safe command is due, or work is to go on
    notice_s: Mapping[str, float] = field(default_factory=dict)  # by stream: how long until it can be told at all
    lasts_s: float = 0.9


FAULTS: Final = (
    StreamFault("off", Off, "no sample any more"),
    StreamFault("stuck", Stuck, "the last sample again and again, old stamp"),
    StreamFault(
        "frozen",
        Frozen,
        "the last values again and again under new stamps",
        notice_s={"keypoints": 0.3, "horizon": 0.3, "wrench": 0.3, "odometry": 0.3, "command": 0.2},
        lasts_s=1.2,
    ),
    StreamFault("garbage", Garbage, "random bytes of the right length"),
    StreamFault("wrong value", WrongValue, "well-formed, but not a number or 10^6, in turn"),
    StreamFault("slow", Slow, "one sample in twice the allowed age"),
    StreamFault("delayed", Delayed, "every sample late by one and a half times the allowed age"),
    StreamFault("intermittent", Intermittent, "silence and samples in turn, twice the allowed age each"),
    StreamFault("clock ahead", ClockAhead, "the publisher's clock jumps 5 s ahead"),
    StreamFault("clock behind", ClockBehind, "the publisher's clock jumps 5 s back"),
    StreamFault("half rate", HalfRate, "every second sample missing", stops=False),
    StreamFault("late", Late, "every sample late by a quarter of the allowed age", stops=False),
    StreamFault("lossy", Lossy, "every third sample missing", stops=False),
)
