"""Cameras and network streams: a thread keeps the newest frame, the node takes it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol

from bridge.clock import Clock, nanoseconds
from bridge.errors import SourceError
from perception.extras import load_opencv
from perception.sources.frame import Frame
from perception.sources.picture import Crop, to_rgb

_REOPEN_S = 1.0
_LONGEST_WAIT_S = 0.050


class Capture(Protocol):
    """What is used of `cv2.VideoCapture`."""

    def isOpened(self) -> bool:  # noqa: N802 (OpenCV's name)
        """Whether the camera answered."""
        ...

    def read(self) -> tuple[bool, Any]:
        """Wait for a frame; return whether there is one, and the BGR image."""
        ...

    def release(self) -> None:
        """Let go of the camera."""
        ...


class Camera:
    """A `Source` of live frames.

    OpenCV tells no exposure time, so a frame is stamped when it arrives, less the
    delay that was measured. Frames nobody took are dropped: the newest counts. A camera that stops answering is
    opened again every second; meanwhile there are no frames, and the reader sees
    their age grow.
    """

    def __init__(
        self,
        name: str,
        open_capture: Callable[[], Capture],
        crop: Crop | None,
        clock: Clock,
        latency_s: float = 0.0,
    ) -> None:
        """Open the camera and wait for its first frame.

        Args:
            name: what messages call it.
            open_capture: opens it, again after every failure.
            crop: part of each image that is used.
            clock: stamps the frames.
            latency_s: from exposure to arrival [s].

        Raises:
            SourceError: it does not open or gives no frame, or the crop does not fit.
        """
        self._name = name
        self._open_capture = open_capture
        self._crop = crop
        self._clock = clock
        self._latency_ns = nanoseconds(latency_s)
        self._newest: Frame | None = None
        self._fault: SourceError | None = None
        self._lock = threading.Lock()
        self._arrived = threading.Event()
        self._stop = threading.Event()
        capture = open_capture()
        if not capture.isOpened():
            raise SourceError(f"{name}: does not open as a camera or stream")
        try:
            if not self._take(capture):
                raise SourceError(f"{name}: opens but gives no frame")
        except SourceError:
            capture.release()
            raise
        self._thread = threading.Thread(target=self._run, args=(capture,), name=name, daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        """What messages call it."""
        return self._name

    @property
    def gives_images(self) -> bool:
        """Yes: an estimator is needed."""
        return True

    @property
    def finished(self) -> bool:
        """Never: a silent camera may come back."""
        return False

    def next(self, now_ns: int) -> Frame | None:  # noqa: ARG002 (live frames are due when they arrive)
        """Return the newest frame if it was not given before.

        Raises:
            SourceError: the camera came back with another image size that the crop does not fit.
        """
        with self._lock:
            frame, self._newest = self._newest, None
            self._arrived.clear()
            if self._fault is not None:
                raise self._fault
        return frame

    def wait(self, clock: Clock) -> None:  # noqa: ARG002 (a camera's frames come on the machine's own clock)
        """Return when a frame has arrived, at the latest after 50 ms."""
        self._arrived.wait(_LONGEST_WAIT_S)

    def close(self) -> None:
        """Stop the thread; it may be waiting for a frame, which ends it too."""
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self, capture: Capture) -> None:
        try:
            while not self._stop.is_set():
                if self._take(capture):
                    continue
                capture.release()
                self._stop.wait(_REOPEN_S)
                capture = self._open_capture()
        except SourceError as error:
            with self._lock:
                self._fault = error
            self._arrived.set()
        finally:
            capture.release()

    def _take(self, capture: Capture) -> bool:
        """Wait for one frame and keep it; return whether there was one."""
        read, bgr = capture.read()
        if not read:
            return False
        stamp_ns = self._clock.now_ns() - self._latency_ns
        image = to_rgb(bgr, self._crop, self._name)
        with self._lock:
            self._newest = Frame(stamp_ns, image.shape[1], image.shape[0], image, ())
        self._arrived.set()
        return True


def open_camera(address: int | str, crop: Crop | None, clock: Clock, latency_s: float = 0.0) -> Camera:
    """Open camera number or stream URL `address`.

    Raises:
        SourceError: it does not open or gives no frame.
        MissingExtraError: OpenCV is not installed.
    """
    cv2 = load_opencv("reading a camera", "video")

    def open_capture() -> Capture:
        capture: Capture = cv2.VideoCapture(address)
        return capture

    name = f"camera:{address}" if isinstance(address, int) else address
    return Camera(name, open_capture, crop, clock, latency_s)
