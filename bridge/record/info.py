"""What is in a recording: how much, how regular, how old on arrival, and what is missing."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.record.reader import Recorded, Recording
from bridge.topics import TOPICS, Topic

NAN = float("nan")
LOOK_EVERY: Final = 1000  # messages


class TopicInfo(NamedTuple):
    """One topic of a recording; NaN where there are too few messages to say."""

    topic: str  # ROS 2 name
    type: str
    messages: int
    rate_hz: float  # mean, from the first to the last message
    largest_gap_s: float  # between two messages that follow each other
    age_p50_ms: float  # arrival minus the message's stamp
    age_p99_ms: float
    age_max_ms: float
    publishers: int  # that number their messages
    missing: int  # numbers that were skipped, over all publishers
    disordered: int  # messages that came after a later one of the same publisher, or twice


class RecordingInfo(NamedTuple):
    """A whole recording."""

    path: str
    bytes: int
    start_ns: int  # first arrival [ns since the epoch]
    duration_s: float
    messages: int
    damage: str  # '' if the file is whole
    topics: list[TopicInfo]
    foreign: dict[str, int]  # topics that are not Surefoot's -> messages


def summarise(recording: Recording, looked: Callable[[], object] = lambda: None) -> RecordingInfo:
    """Read `recording` to its end and return what is in it; `looked` is called every thousand messages.

    Raises:
        SourceError: the file cannot be read.
    """
    tallies: dict[str, _Tally] = {}
    first_ns = last_ns = 0
    for number, recorded in enumerate(recording.samples()):
        if number % LOOK_EVERY == 0:
            looked()
        last_ns = recorded.log_time_ns
        first_ns = first_ns or last_ns
        tallies.setdefault(recorded.topic.key, _Tally()).add(recorded)
    prefix = f"/{recording.namespace}" if recording.namespace else ""
    return RecordingInfo(
        path=str(recording.path),
        bytes=sum(file.stat().st_size for file in recording.files),
        start_ns=first_ns,
        duration_s=(last_ns - first_ns) / NS,
        messages=sum(tally.count for tally in tallies.values()),
        damage=recording.damage,
        topics=[
            tallies.get(topic.key, _Tally()).info(topic, f"{prefix}/{topic.key}")
            for topic in TOPICS
            if topic.key in tallies or topic.key in recording.listened
        ],
        foreign={name: count for (name, _type), count in recording.foreign.items()},
    )


class _Tally:
    """What is counted of one topic while its messages go by in order of arrival."""

    def __init__(self) -> None:
        self.count = 0
        self._first_ns = self._last_ns = self._largest_gap_ns = 0
        self._ages_ns = array("d")
        self._numbers: dict[bytes, int] = {}  # publisher -> its highest number
        self._missing = self._disordered = 0

    def add(self, recorded: Recorded) -> None:
        arrival_ns = recorded.log_time_ns
        if self.count:
            self._largest_gap_ns = max(self._largest_gap_ns, arrival_ns - self._last_ns)
        else:
            self._first_ns = arrival_ns
        self._last_ns = arrival_ns
        self.count += 1
        self._ages_ns.append(arrival_ns - recorded.publish_time_ns)
        if recorded.sample.sequence >= 0:
            self._number(recorded.sample.source, recorded.sample.sequence)

    def info(self, topic: Topic, name: str) -> TopicInfo:
        span_s = (self._last_ns - self._first_ns) / NS
        ages_ms = np.array(self._ages_ns, dtype=np.float64) / 1e6 if self.count else np.array([NAN])
        p50, p99, highest = (float(value) for value in np.percentile(ages_ms, (50, 99, 100)))
        return TopicInfo(
            topic=name,
            type=topic.ros_type,
            messages=self.count,
            rate_hz=(self.count - 1) / span_s if span_s > 0.0 else NAN,
            largest_gap_s=self._largest_gap_ns / NS if self.count > 1 else NAN,
            age_p50_ms=p50,
            age_p99_ms=p99,
            age_max_ms=highest,
            publishers=len(self._numbers),
            missing=self._missing,
            disordered=self._disordered,
        )

    def _number(self, source: bytes, number: int) -> None:
        highest = self._numbers.get(source)
        if highest is None:
            self._numbers[source] = number
        elif number > highest:
            self._missing += number - highest - 1
            self._numbers[source] = number
        else:
            self._disordered += 1
