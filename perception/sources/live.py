"""Live frames from a generator: a thread keeps the newest, the node takes it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Final

import numpy as np

from bridge.clock import NS, Clock
from bridge.errors import SourceError
from bridge.messages import KEYPOINTS
from perception.sources.frame import Frame

_LONGEST_WAIT_S: Final = 0.050
_FIRST_AGE_S: Final = 2.0  # the first frame may have waited in a camera's queue, but it is not from another clock
_PERSON: Final = (KEYPOINTS, 3)


class Live:
    """A `Source` of what a generator yields.

    Frames nobody took are dropped: the newest counts. When the generator ends, so does the source; what it raises
    after the first frame is raised from `next`, which ends the process, and `surefoot up` starts it again.
    """

    def __init__(self, name: str, frames: Iterator[Frame], clock: Clock) -> None:
        """Wait for the first frame.

        Raises:
            SourceError: there is none, or it is not what a frame must be.
        """
        self._name = name
        self._frames = frames
        self._newest: Frame | None = None
        self._fault: Exception | None = None
        self._lock = threading.Lock()
        self._arrived = threading.Event()
        self._stop = threading.Event()
        self._ended = False
        first = next(frames, None)
        if first is None:
            raise SourceError(f"{name}: gives no frame")
        self._newest = self._checked(first)
        self._gives_images = self._newest.image is not None
        self._require_clock(self._newest.stamp_ns, clock)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """What messages call it."""
        return self._name

    @property
    def gives_images(self) -> bool:
        """Whether its frames are images, and not keypoints found already."""
        return self._gives_images

    @property
    def finished(self) -> bool:
        """Whether the generator has ended and its last frame was taken."""
        with self._lock:
            return self._ended and self._newest is None and self._fault is None

    def next(self, now_ns: int) -> Frame | None:  # noqa: ARG002 (live frames are due when they arrive)
        """Return the newest frame if it was not given before.

        Raises:
            Exception: whatever the generator raised.
        """
        with self._lock:
            frame, self._newest = self._newest, None
            self._arrived.clear()
            if frame is None and self._fault is not None:
                raise self._fault
        return frame

    def wait(self, clock: Clock) -> None:  # noqa: ARG002 (its frames come on the machine's own clock)
        """Return when a frame has arrived, at the latest after 50 ms."""
        self._arrived.wait(_LONGEST_WAIT_S)

    def close(self) -> None:
        """Stop taking frames; the generator is closed once it has given the one it is waiting for."""
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        try:
            for frame in self._frames:
                if self._stop.is_set():
                    break
                checked = self._checked(frame)
                with self._lock:
                    self._newest = checked
                self._arrived.set()
        except Exception as error:  # noqa: BLE001 (it is raised again where the node can see it)
            with self._lock:
                self._fault = error
        finally:
            with self._lock:
                self._ended = True
            self._arrived.set()
            close = getattr(self._frames, "close", None)
            if close is not None:
                close()

    def _checked(self, frame: Frame) -> Frame:
        """Return `frame` with its people as arrays of float64.

        Raises:
            SourceError: it is no frame, or holds something of another shape.
        """
        if not isinstance(frame, Frame):
            raise SourceError(f"{self._name}: gave a {type(frame).__name__}, expected perception.sources.frame.Frame")
        if frame.image is not None:
            shape, wanted = np.shape(frame.image), (frame.height, frame.width, 3)
            if shape != wanted or frame.image.dtype != np.uint8:
                raise SourceError(f"{self._name}: image is {frame.image.dtype} {shape}, expected uint8 {wanted}, RGB")
            return frame
        people = tuple(np.array(person, dtype=np.float64) for person in frame.people)
        for person in people:
            if person.shape != _PERSON:
                raise SourceError(
                    f"{self._name}: a person has shape {person.shape}, expected {_PERSON}: x, y, confidence"
                )
        return frame._replace(people=people)

    def _require_clock(self, stamp_ns: int, clock: Clock) -> None:
        age_s = (clock.now_ns() - stamp_ns) / NS
        if abs(age_s) > _FIRST_AGE_S:
            raise SourceError(
                f"{self._name}: the first frame is stamped {age_s:.3g} s before now, limit {_FIRST_AGE_S:g}: "
                "stamps are nanoseconds of the clock that was given, clock.now_ns()"
            )
