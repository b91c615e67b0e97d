"""A process between publisher and reader: everything passes through it, and what it is told to spoils on the way.

Each node runs in a namespace of its own and hears only what the relay puts there, so
the nodes are as they are shipped: the same modules, the same wire, the same configuration keys.
"""

from __future__ import annotations

import heapq
import itertools
import json
import threading
from collections import deque
from collections.abc import Iterable
from typing import Any, Final, NamedTuple, Self

import zenoh

from benchmarks.faults.stream_faults import Carried, Passage, StreamFault
from bridge.clock import NS, Clock
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic

READERS: Final = {
    KEYPOINTS: "anticipation",
    FALL_HORIZON: "controller",
    WRENCH: "controller",
    ODOMETRY: "controller",
    SUPPORT_COMMAND: "drive",
}


class Seen(NamedTuple):
    """A sample as its publisher sent it."""

    arrival_ns: int
    payload: bytes
    attachment: bytes


class Delivered(NamedTuple):
    """A sample as its reader got it."""

    at_ns: int
    stamp_ns: int
    good: bool


class Relay:
    """Carries every stream from its publisher's namespace into its reader's."""

    def __init__(self, port: int, base: str, clock: Clock) -> None:
        self._clock = clock
        self._session: Any = zenoh.open(_config(port))
        self.seen: dict[str, deque[Seen]] = {topic.key: deque() for topic in (*READERS, DIAGNOSTICS)}
        self.delivered: dict[str, deque[Delivered]] = {topic.key: deque() for topic in READERS}
        self._held: list[tuple[int, int, str, Carried]] = []  # when, number, key, sample
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._open = True
        self._passages: dict[str, Passage] = {}
        self._last: dict[str, Carried] = {}
        self._publishers = {
            topic.key: self._session.declare_publisher(
                f"{base}/{reader}/{topic.key}",
                congestion_control=zenoh.CongestionControl.DROP,
                priority=getattr(zenoh.Priority, topic.priority.upper()),
                express=topic.express,
            )
            for topic, reader in READERS.items()
        }
        self._subscribers = [
            self._listen(f"{base}/{topic.publisher}/{topic.key}", topic) for topic in (*READERS, DIAGNOSTICS)
        ]
        self._worker = threading.Thread(target=self._release, daemon=True)
        self._worker.start()

    def inject(self, topic: Topic, fault: StreamFault) -> None:
        """Let `fault` happen to `topic` from now on."""
        self._passages[topic.key] = fault.passage(topic, self._last.get(topic.key))

    def mend(self, topic: Topic) -> None:
        """Let `topic` pass again, and forget what is held back."""
        self._passages.pop(topic.key, None)
        with self._changed:
            self._held = [entry for entry in self._held if entry[2] != topic.key]
            heapq.heapify(self._held)

    def close(self) -> None:
        """Leave the wire."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._worker.join()
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _listen(self, key: str, topic: Topic) -> Any:
        def take(sample: Any) -> None:
            attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
            carried = Carried(sample.payload.to_bytes(), attachment)
            now_ns = self._clock.now_ns()
            self.seen[topic.key].append(Seen(now_ns, carried.payload, attachment))
            if topic is not DIAGNOSTICS:
                self._carry(topic.key, carried, now_ns)

        return self._session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))

    def _carry(self, key: str, sample: Carried, now_ns: int) -> None:
        passage = self._passages.get(key)
        result = sample if passage is None else passage.take(sample, now_ns)
        if result is None:
            return
        if result.delay_ns:
            with self._changed:
                heapq.heappush(self._held, (now_ns + result.delay_ns, next(self._numbers), key, result))
                self._changed.notify()
            return
        if passage is None:
            self._last[key] = sample
        self._deliver(key, result, now_ns)

    def _deliver(self, key: str, sample: Carried, now_ns: int) -> None:
        self.delivered[key].append(Delivered(now_ns, sample.stamp_ns if sample.good else 0, sample.good))
        self._publishers[key].put(sample.payload, attachment=sample.attachment)

    def _release(self) -> None:
        """Send what was held back when its time has come."""
        while True:
            with self._changed:
                if not self._open:
                    return
                now_ns = self._clock.now_ns()
                if not self._held or self._held[0][0] > now_ns:
                    self._changed.wait((self._held[0][0] - now_ns) / NS if self._held else None)
                    continue
                _, _, key, sample = heapq.heappop(self._held)
            self._deliver(key, sample, self._clock.now_ns())


def _config(port: int) -> Any:
    settings: Iterable[tuple[str, object]] = (
        ("mode", "router"),  # so that what else connects here shares one network
        ("listen/endpoints", [f"tcp/127.0.0.1:{port}"]),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
    )
    config = zenoh.Config()
    for path, value in settings:
        config.insert_json5(path, json.dumps(value))
    return config
