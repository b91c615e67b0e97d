"""Playing stored frames in real time, or as fast as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from bridge.clock import Clock, nanoseconds
from bridge.errors import SourceError
from bridge.messages import Floats
from perception.sources.frame import Frame, Image

_LONGEST_WAIT_NS = nanoseconds(0.050)
_LATE_NS = nanoseconds(0.100)


class Still(NamedTuple):
    """One stored frame."""

    offset_ns: int  # since the first frame [ns]
    width: int  # [px]
    height: int  # [px]
    image: Image | None  # (height, width, 3) RGB
    people: tuple[Floats, ...]  # (12, 3) each


class Playback:
    """A `Source` of stored frames.

    The first frame is due when it is first asked for. Each is stamped with the time
    at which it is due, so ages are those of a live camera. Paced, a frame that is
    more than 0.1 s late is skipped when the one after it is due as well, as a
    camera would; unpaced, every frame is due at once and none is skipped.
    """

    def __init__(self, name: str, stills: Iterator[Still], *, paced: bool) -> None:
        """Take the first of `stills`.

        Raises:
            SourceError: there is none.
        """
        self._name = name
        self._stills = stills
        self._paced = paced
        self._origin_ns: int | None = None
        self._upcoming = next(stills, None)
        if self._upcoming is None:
            raise SourceError(f"{name}: holds no frame")
        self._gives_images = self._upcoming.image is not None

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
        """Whether every frame was given."""
        return self._upcoming is None

    def next(self, now_ns: int) -> Frame | None:
        """Return the next frame if it is due at `now_ns`."""
        if self._origin_ns is None:
            self._origin_ns = now_ns
        still = self._upcoming
        if still is None or not self._due(still, now_ns):
            return None
        self._upcoming = next(self._stills, None)
        while self._upcoming is not None and self._due(self._upcoming, now_ns - _LATE_NS) and self._paced:
            still = self._upcoming
            self._upcoming = next(self._stills, None)
        return Frame(self._origin_ns + still.offset_ns, still.width, still.height, still.image, still.people)

    def wait(self, clock: Clock) -> None:
        """Sleep until the next frame is due, at most 50 ms."""
        latest_ns = clock.now_ns() + _LONGEST_WAIT_NS
        if self._upcoming is None:
            return
        if self._origin_ns is not None and self._paced:
            clock.sleep_until(min(self._origin_ns + self._upcoming.offset_ns, latest_ns))

    def close(self) -> None:
        """Stop; what is left is not given."""
        self._upcoming = None
        close = getattr(self._stills, "close", None)
        if close is not None:
            close()

    def _due(self, still: Still, now_ns: int) -> bool:
        return not self._paced or (self._origin_ns or 0) + still.offset_ns <= now_ns
