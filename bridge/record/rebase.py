"""Moving a recording's times to now, in the payloads too, so that live readers find the messages fresh."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from rosbags.serde import SerdeError

from bridge.clock import NS
from bridge.codec import TYPES
from bridge.record.layout import header_stamp_ns
from bridge.topics import SUPPORT_COMMAND, Topic

_LATEST_NS = (1 << 31) * NS  # seconds are int32
_Time = TYPES.types["builtin_interfaces/msg/Time"]


class TimeMap(NamedTuple):
    """`start_ns + (t - first_ns) / rate`: one map for arrivals and stamps, so that what was equal stays equal.

    At a rate other than 1 the ages are stretched with everything else.
    """

    first_ns: int  # first arrival in the recording
    start_ns: int  # when it is replayed
    rate: float  # replayed seconds of the recording per second

    def to_now(self, recorded_ns: int) -> int:
        """Return when what happened at `recorded_ns` happens in the replay [ns since the epoch]."""
        return self.start_ns + round((recorded_ns - self.first_ns) / self.rate)


def rebase(topic: Topic, payload: bytes, times: TimeMap) -> tuple[bytes, int]:
    """Return `payload` with its stamps moved, and the new stamp of its header [ns].

    What does not decode is returned as it is: a reader that was given garbage then is given it again.
    """
    stamp_ns = header_stamp_ns(payload)
    if stamp_ns is None:
        return payload, times.start_ns
    moved_ns = times.to_now(stamp_ns)
    try:
        raw: Any = TYPES.deserialize_cdr(payload, topic.ros_type)
        raw.header.stamp = _time(moved_ns)
        if topic == SUPPORT_COMMAND and _ns(raw.rests_on):  # zero says that there was no frame
            raw.rests_on = _time(times.to_now(_ns(raw.rests_on)))
        return bytes(TYPES.serialize_cdr(raw, topic.ros_type)), moved_ns
    except (SerdeError, struct.error, ValueError, TypeError, IndexError, OverflowError, MemoryError):
        return payload, times.start_ns


def _time(stamp_ns: int) -> Any:
    if not 0 <= stamp_ns < _LATEST_NS:
        raise ValueError(f"stamp {stamp_ns} ns does not fit builtin_interfaces/Time")
    return _Time(sec=stamp_ns // NS, nanosec=stamp_ns % NS)


def _ns(stamp: Any) -> int:
    return int(stamp.sec) * NS + int(stamp.nanosec)
