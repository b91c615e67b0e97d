"""What a source gives: frames with capture stamps, of images or of keypoints found already."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bridge.clock import Clock
from bridge.messages import Floats

Image: TypeAlias = NDArray[np.uint8]


class Frame(NamedTuple):
    """One frame as captured: it holds either an image or the people found in it."""

    stamp_ns: int  # exposure [ns]
    width: int  # [px]
    height: int  # [px]
    image: Image | None  # (height, width, 3) RGB
    people: tuple[Floats, ...]  # (12, 3) each: x, y [px], confidence; NaN where not found


class Source(Protocol):
    """Where frames come from."""

    @property
    def name(self) -> str:
        """What messages call it."""
        ...

    @property
    def gives_images(self) -> bool:
        """Whether an estimator is needed to find people in its frames."""
        ...

    @property
    def finished(self) -> bool:
        """Whether no frame will ever come again."""
        ...

    def next(self, now_ns: int) -> Frame | None:
        """Return the next frame that is due at `now_ns`, or None; never waits for one."""
        ...

    def wait(self, clock: Clock) -> None:
        """Return when there may be a frame, at the latest after 50 ms."""
        ...

    def close(self) -> None:
        """Release what the source holds."""
        ...
