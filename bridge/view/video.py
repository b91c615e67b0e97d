"""Frames of the video that the keypoints were found in, laid under them by their stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final, Protocol

from bridge.clock import NS, nanoseconds
from bridge.errors import SourceError
from bridge.messages import Keypoints
from bridge.topics import KEYPOINTS
from bridge.transport.interface import Sample
from bridge.view.body import IMAGE
from bridge.view.canvas import Canvas, Moment

JPEG_QUALITY: Final = 75
_PERIOD_NS: Final = NS / KEYPOINTS.rate_hz
_AHEAD_NS: Final = round(0.5 * _PERIOD_NS)  # a frame this little later than its keypoints belongs to them


class Still(Protocol):
    """What is needed of `perception.sources.playback.Still`."""

    @property
    def offset_ns(self) -> int:
        """Since the first frame [ns]."""
        ...

    @property
    def image(self) -> Any:
        """(H, W, 3) RGB; None in a keypoint file."""
        ...


class Video:
    """Shows each frame at the stamp that perception gave it.

    Perception numbers its messages from the first frame on, one for every tick of 30 Hz, so any
    of them tells when the first frame was. When perception starts anew, so does the video.
    """

    def __init__(self, name: str, reopen: Callable[[], Iterator[Still]], offset_s: float = 0.0) -> None:
        self._name, self._reopen, self._offset_ns = name, reopen, nanoseconds(offset_s)
        self._stills = reopen()
        self._next = next(self._stills, None)
        if self._next is None or self._next.image is None:
            raise SourceError(f"{name}: holds no picture")
        self._source: bytes | None = None
        self._origin_ns = 0

    def show(self, canvas: Canvas, keypoints: Keypoints, sample: Sample) -> None:
        """Draw the frames up to those of `keypoints`.

        Raises:
            SourceError: the video's size is not that of the image the keypoints are given in.
        """
        if not self._begun(keypoints, sample):
            return
        until_ns = keypoints.stamp_ns + _AHEAD_NS
        while self._next is not None and (stamp_ns := self._origin_ns + self._next.offset_ns) <= until_ns:
            self._require_size(self._next, keypoints)
            image = canvas.sdk.Image(self._next.image, draw_order=-10.0).compress(jpeg_quality=JPEG_QUALITY)
            canvas.at(Moment(stamp_ns, sample.arrival_ns))
            canvas.draw(f"{IMAGE}/frame", image)
            self._next = next(self._stills, None)

    def _begun(self, keypoints: Keypoints, sample: Sample) -> bool:
        """Whether it is known when the first frame was."""
        if sample.source == self._source:
            return True
        if not keypoints.valid:  # a stalled source repeats itself, and its numbers are no clock
            return False
        if self._source is not None:
            self._stills = self._reopen()
            self._next = next(self._stills, None)
        self._source = sample.source
        self._origin_ns = keypoints.stamp_ns - round(keypoints.sequence * _PERIOD_NS) + self._offset_ns
        return True

    def _require_size(self, still: Still, keypoints: Keypoints) -> None:
        height, width = still.image.shape[:2]
        if (width, height) != (keypoints.image_width, keypoints.image_height):
            raise SourceError(
                f"{self._name}: its pictures are {width}x{height}, the keypoints are in "
                f"{keypoints.image_width}x{keypoints.image_height}; --crop X,Y,W,H names the part that was used"
            )
