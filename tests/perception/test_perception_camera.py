"""A camera that the test plays: frames come when the test hands them in, and time is the test's."""

import queue
import threading
from typing import Any

import numpy as np
import pytest

from bridge.clock import NS, ManualClock
from bridge.config.perception import SourceConfig
from bridge.errors import SourceError
from perception.sources.camera import Camera
from perception.sources.open import open_source


class FakeCapture:
    """Gives what was put in; None is a failure to read."""

    def __init__(self, opened: bool = True) -> None:
        self.images: queue.Queue[Any] = queue.Queue()
        self.opened = opened
        self.released = threading.Event()

    def isOpened(self) -> bool:  # noqa: N802
        return self.opened

    def read(self) -> tuple[bool, Any]:
        image = self.images.get(timeout=5.0)
        return image is not None, image

    def release(self) -> None:
        self.released.set()


def picture(value: int, width: int = 8) -> Any:
    return np.full((6, width, 3), value, dtype=np.uint8)


def test_the_newest_frame_is_given_once_with_its_arrival() -> None:
    capture, clock = FakeCapture(), ManualClock(7 * NS)
    capture.images.put(picture(1))
    camera = Camera("fake", lambda: capture, (2, 0, 4, 6), clock)
    frame = camera.next(0)
    assert frame is not None
    assert frame.stamp_ns == 7 * NS
    assert (frame.width, frame.height) == (4, 6)
    assert camera.next(0) is None
    clock.advance(1.0)
    capture.images.put(picture(2))
    while (frame := camera.next(0)) is None:
        camera.wait(clock)
    assert frame.image is not None
    assert (frame.stamp_ns, int(frame.image[0, 0, 0])) == (8 * NS, 2)
    assert not camera.finished
    capture.images.put(None)
    camera.close()
    assert capture.released.is_set()


def test_a_measured_delay_is_taken_off_the_stamp() -> None:
    capture, clock = FakeCapture(), ManualClock(7 * NS)
    capture.images.put(picture(1))
    camera = Camera("fake", lambda: capture, None, clock, latency_s=0.08)
    frame = camera.next(0)
    assert frame is not None
    assert frame.stamp_ns == 7 * NS - 80_000_000
    capture.images.put(None)
    camera.close()


def test_a_camera_that_does_not_open_or_gives_nothing_is_said() -> None:
    with pytest.raises(SourceError, match="fake: does not open"):
        Camera("fake", lambda: FakeCapture(opened=False), None, ManualClock())
    silent = FakeCapture()
    silent.images.put(None)
    with pytest.raises(SourceError, match="fake: opens but gives no frame"):
        Camera("fake", lambda: silent, None, ManualClock())
    assert silent.released.is_set()


def test_a_crop_that_stops_fitting_is_said() -> None:
    capture = FakeCapture()
    capture.images.put(picture(1))
    camera = Camera("fake", lambda: capture, (0, 0, 8, 6), ManualClock())
    assert camera.next(0) is not None
    capture.images.put(picture(1, width=4))
    assert capture.released.wait(5.0)
    with pytest.raises(SourceError, match="reaches outside the 4x6 image"):
        camera.next(0)
    camera.close()


def test_a_camera_that_is_not_there_is_said() -> None:
    with pytest.raises(SourceError, match="camera:987: does not open"):
        open_source("camera:987", SourceConfig(), ManualClock())
