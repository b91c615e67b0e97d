"""Hearing a running system: samples wait in bounded queues until the scene has time for them."""

from __future__ import annotations

import heapq
from collections import deque
from functools import partial
from typing import Final

from bridge.topics import Topic
from bridge.transport.interface import Handle, Sample, Transport
from bridge.view.scene import SHOWN, Scene

POLL_S: Final = 0.05
WAITING: Final = 2048  # samples of one topic, 20 s of the fastest; beyond it the oldest is dropped


class Ear:
    """Subscribes to what is shown. Publishes nothing and declares nothing, so that its end changes nothing."""

    def __init__(self, transport: Transport) -> None:
        self.lost = 0  # samples that waited too long
        self._waiting: dict[Topic, deque[Sample]] = {topic: deque(maxlen=WAITING) for topic in SHOWN}
        self._roles: deque[tuple[str, bool]] = deque()
        self._handles: list[Handle] = [
            transport.subscribe(topic, partial(self._store, waiting)) for topic, waiting in self._waiting.items()
        ]
        self._handles.append(transport.watch_alive(lambda role, alive: self._roles.append((role, alive))))

    def tell(self, scene: Scene, now_ns: int) -> None:
        """Hand the scene what has come, in order of arrival, and then the time."""
        while self._roles:
            scene.alive(*self._roles.popleft(), now_ns)
        for _, _, topic, sample in heapq.merge(*(self._take(number) for number in range(len(SHOWN)))):
            scene.hear(topic, sample)
        scene.look(now_ns)

    def close(self) -> None:
        """Stop listening."""
        for handle in self._handles:
            handle.close()

    def _store(self, waiting: deque[Sample], sample: Sample) -> None:
        self.lost += len(waiting) == WAITING
        waiting.append(sample)

    def _take(self, number: int) -> list[tuple[int, tuple[int, int], Topic, Sample]]:
        topic = SHOWN[number]
        waiting = self._waiting[topic]
        samples = [waiting.popleft() for _ in range(len(waiting))]
        return [(sample.arrival_ns, (number, index), topic, sample) for index, sample in enumerate(samples)]
