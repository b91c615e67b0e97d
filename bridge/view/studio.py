"""One showing: the stream, where it goes, and the scene that is drawn on it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple

from numpy.typing import NDArray

from bridge.clock import NS, Clock
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.messages import Keypoints
from bridge.record.reader import Recording
from bridge.topics import KEYPOINTS
from bridge.transport.interface import Transport
from bridge.view.canvas import Canvas
from bridge.view.extra import Rerun
from bridge.view.geometry import Plane
from bridge.view.layout import Look, layout
from bridge.view.listen import POLL_S, Ear
from bridge.view.rrd import RrdFile
from bridge.view.scene import SHOWN, Scene
from bridge.view.video import Video
from bridge.view.viewer import Viewer

APPLICATION: Final = "surefoot"
FILE_FLUSH_S: Final = 1.0  # a file needs no haste, and fewer, larger chunks make it smaller
FLUSH_EVERY: Final = 2000  # samples of a recording between two flushes
GOODBYE_S: Final = 2.0


class Subject(NamedTuple):
    """What is needed to draw, beside the messages."""

    config: SurefootConfig
    plane: Plane
    links: NDArray[Any]
    video: Video | None


class Studio:
    """Draws on every one of `viewers` and into `file`."""

    def __init__(self, rerun: Rerun, subject: Subject, viewers: Sequence[Viewer], file: RrdFile | None) -> None:
        self._rerun, self._subject, self._viewers, self._file = rerun, subject, viewers, file
        sdk = rerun.sdk
        self._flush_s = POLL_S if viewers else FILE_FLUSH_S
        self._stream = sdk.RecordingStream(APPLICATION, batcher_config=sdk.ChunkBatcherConfig(flush_tick=self._flush_s))
        sinks = [sdk.GrpcSink(viewer.url) for viewer in viewers]
        self._stream.set_sinks(*sinks, *([] if file is None else [sdk.FileSink(file.part)]))
        self._canvas = Canvas(rerun, self._stream)
        self._scene = Scene(self._canvas, subject.config, subject.plane, subject.links, subject.video)

    @property
    def watched(self) -> bool:
        """Whether nobody has closed the window."""
        return all(viewer.running for viewer in self._viewers)

    def show_live(self, transport: Transport, clock: Clock, ended: Callable[[], bool]) -> int:
        """Show what runs until `ended`; return how many samples came faster than they could be drawn."""
        source = self._subject.config.perception.source
        size = (source.image_width_px, source.image_height_px)
        self._arrange(size, None)
        ear = Ear(transport)
        try:
            flushed_s = time.monotonic()
            while not ended():
                ear.tell(self._scene, clock.now_ns())
                seen = self._scene.image_size
                if seen is not None and seen != size:
                    size = seen
                    self._arrange(size, None)
                if time.monotonic() - flushed_s >= self._flush_s:
                    self._canvas.flush()
                    flushed_s = time.monotonic()
                time.sleep(POLL_S)
            ear.tell(self._scene, clock.now_ns())
        finally:
            ear.close()
        return ear.lost

    def show_recording(self, recording: Recording, ended: Callable[[], bool]) -> None:
        """Show a whole recording, as fast as it can be read.

        Raises:
            SourceError: it holds nothing that could be shown.
        """
        self._arrange(_image_size(recording, self._subject.config), _length_s(recording))
        for index, recorded in enumerate(recording.samples(SHOWN)):
            self._scene.hear(recorded.topic, recorded.sample)
            if index % FLUSH_EVERY == 0:
                self._canvas.flush()
                if ended():
                    break
        if not self._scene.shown:
            raise SourceError(f"{recording.path}: none of its messages can be decoded")

    def finish(self) -> None:
        """Send what is waiting and give the file its name.

        Raises:
            SurefootError: the file could not be written whole.
        """
        self._canvas.flush()
        with suppress(Exception):  # a viewer that was closed takes nothing any more
            self._stream.flush(timeout_sec=GOODBYE_S if self._viewers else 600.0)
        self._stream.disconnect()
        if self._file is not None:
            self._file.finish()

    def _arrange(self, image_size: tuple[int, int], length_s: float | None) -> None:
        self._stream.send_blueprint(layout(self._rerun, Look(self._subject.plane, image_size, length_s)))


def require_messages(recording: Recording) -> None:
    """Raise unless there is something of ours in `recording`.

    Raises:
        SourceError: there is not.
    """
    if next(recording.samples(SHOWN), None) is None:
        damage = f" ({recording.damage})" if recording.damage else ""
        raise SourceError(f"{recording.path}: holds no message of Surefoot's topics{damage}")


def _image_size(recording: Recording, config: SurefootConfig) -> tuple[int, int]:
    """Return width and height of the image that the first keypoints are given in."""
    for _, message, _ in recording.messages([KEYPOINTS]):
        if isinstance(message, Keypoints):
            return message.image_width, message.image_height
    return config.perception.source.image_width_px, config.perception.source.image_height_px


def _length_s(recording: Recording) -> float:
    """Return the time from the first message to the last [s]."""
    times_ns = [recorded.log_time_ns for recorded in recording.samples(SHOWN)]
    return (max(times_ns) - min(times_ns)) / NS
