"""Detections that another process publishes: the simulator, or a pose estimator of one's own."""

from __future__ import annotations

from collections import deque
from typing import Protocol

import numpy as np

from bridge.clock import Clock
from bridge.messages import Keypoints, KeypointStatus
from perception.sources.frame import Frame

DEPTH = 16  # detections an inbox should keep for it
_LONGEST_WAIT_S = 0.050


class Detections(Protocol):
    """Where the messages come from: an inbox of the topic `detections`."""

    def drain(self, now_ns: int) -> list[Keypoints]:
        """Return every message since the last call."""
        ...

    def wait(self, timeout_s: float) -> bool:
        """Block until a message is waiting; return whether one is."""
        ...

    def close(self) -> None:
        """Stop listening."""
        ...


class WireSource:
    """A `Source` of the messages on the topic `detections`, one frame each, with the sender's capture stamps."""

    name = "wire"
    gives_images = False
    finished = False

    def __init__(self, inbox: Detections) -> None:
        self._inbox = inbox
        self._frames: deque[Frame] = deque()

    def next(self, now_ns: int) -> Frame | None:
        """Return the oldest detection that was not given yet."""
        if not self._frames:
            self._frames.extend(_frame(message) for message in self._inbox.drain(now_ns))
        return self._frames.popleft() if self._frames else None

    def wait(self, clock: Clock) -> None:
        """Return when a detection has arrived, at the latest after 50 ms."""
        del clock
        if not self._frames:
            self._inbox.wait(_LONGEST_WAIT_S)

    def close(self) -> None:
        """Stop listening."""
        self._inbox.close()


def _frame(message: Keypoints) -> Frame:
    person = np.column_stack((message.position_px, message.confidence))
    person[message.status == KeypointStatus.LOST] = (np.nan, np.nan, 0.0)
    people = (person,) if message.valid and message.people > 0 else ()
    return Frame(message.stamp_ns, message.image_width, message.image_height, None, people)
