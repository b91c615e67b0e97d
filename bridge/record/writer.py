"""Writing a recording so that whatever ends it, all but the last moment can be read."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, cast

from mcap.writer import CompressionType, Writer

from bridge.errors import SurefootError
from bridge.record.layout import (
    ABOUT,
    LIBRARY,
    MESSAGE_ENCODING,
    METADATA_FILE,
    PROFILE,
    SCHEMA_ENCODING,
    SUFFIX,
    Counted,
    channel_metadata,
    channel_topic,
    header_stamp_ns,
    metadata_text,
    schema_text,
)
from bridge.topics import Topic
from bridge.transport.interface import Sample

CHUNK_BYTES: Final = 1 << 20
MOST_PUBLISHERS: Final = 1024  # of one recording; further ones share a channel that names none


class RecordingError(SurefootError):
    """A recording that cannot be begun or continued: name taken, folder not writable, disk full."""


def require_free(out: Path, *, overwrite: bool = False) -> None:
    """Raise unless a recording can be begun at `out`.

    Raises:
        RecordingError: something is there already, or its folder is not.
    """
    if not overwrite and (out.exists() or out.is_symlink()):
        raise RecordingError(f"{out}: the name is taken; --force replaces it")
    if not out.parent.is_dir():
        raise RecordingError(f"{out}: no such folder: {out.parent}")


class BagWriter:
    """One recording being written: `NAME.mcap`, or a folder `NAME` with `NAME_0.mcap` and `metadata.yaml`.

    Messages are gathered into compressed chunks. `flush` closes the chunk and hands it to the
    disk, so a recording that is cut off loses what came after the last flush and nothing else.
    When writing fails, the file is cut back to its last whole record.
    """

    def __init__(self, out: Path, namespace: str, topics: Iterable[Topic], *, overwrite: bool = False) -> None:
        """Create the file.

        Raises:
            RecordingError: the name is taken, or the file cannot be created.
        """
        require_free(out, overwrite=overwrite)
        self.out, self._namespace = out, namespace
        self.file = out if out.suffix == SUFFIX else out / f"{out.name}_0{SUFFIX}"
        self.messages = 0
        self._counts: dict[tuple[str, str], int] = {
            (channel_topic(namespace, topic), topic.ros_type): 0 for topic in topics
        }
        self._first_ns = self._last_ns = 0
        self._failure = False
        self._whole = 0  # how much of the file is whole records [bytes]
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, bytes], int] = {}
        try:
            self._stream = self._create(overwrite=overwrite)
        except OSError as error:
            raise RecordingError(f"{self.file}: cannot be created: {error.strerror}") from error
        # half of mcap's writer is not annotated
        self._writer: Any = Writer(cast(Any, self._stream), CHUNK_BYTES, CompressionType.ZSTD)
        try:
            self._writer.start(PROFILE, LIBRARY)
            keys = ",".join(topic.key for topic in topics)
            self._writer.add_metadata(ABOUT, {"namespace": namespace, "topics": keys})
            self._mark()
        except OSError as error:
            raise self._failed(error) from error

    @property
    def bytes_written(self) -> int:
        """Size of the file so far [bytes]."""
        return self._stream.offset

    def write(self, topic: Topic, sample: Sample) -> None:
        """Add a sample under its time of arrival.

        Raises:
            RecordingError: the disk is full or gone.
        """
        try:
            channel = self._channel(topic, sample.source if sample.sequence >= 0 else b"")
            stamp_ns = header_stamp_ns(sample.payload)
            self._writer.add_message(
                channel,
                log_time=sample.arrival_ns,
                data=sample.payload,
                publish_time=sample.arrival_ns if stamp_ns is None else stamp_ns,
                sequence=max(sample.sequence, 0) & 0xFFFF_FFFF,
            )
        except OSError as error:
            raise self._failed(error) from error
        self._mark()
        if not self.messages:
            self._first_ns = self._last_ns = sample.arrival_ns
        self._first_ns = min(self._first_ns, sample.arrival_ns)
        self._last_ns = max(self._last_ns, sample.arrival_ns)
        name = (channel_topic(self._namespace, topic), topic.ros_type)
        self._counts[name] = self._counts.get(name, 0) + 1
        self.messages += 1

    def flush(self) -> None:
        """Hand everything written so far to the disk.

        Raises:
            RecordingError: the disk is full or gone.
        """
        try:
            self._writer.flush()
            self._mark()
            self._stream.sync()
        except OSError as error:
            raise self._failed(error) from error

    def finish(self) -> None:
        """Write index and description, and close.

        Raises:
            RecordingError: the disk is full or gone; what was flushed before stays readable.
        """
        counted = Counted(self._counts, self._first_ns, self._last_ns)
        text = metadata_text(self.file, counted)
        try:
            self._writer.flush()
            self._mark()
            self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
            self._mark()
            self._writer.finish()
            self._stream.sync()
            self._stream.close()
            if self.file != self.out:
                (self.out / METADATA_FILE).write_text(text, encoding="utf-8")
        except OSError as error:
            raise self._failed(error) from error

    def discard(self) -> None:
        """Close and remove the recording; after a failure of the disk, leave what it kept."""
        self._stream.close()
        if self._failure:
            return
        self.file.unlink(missing_ok=True)
        if self.file != self.out:
            (self.out / METADATA_FILE).unlink(missing_ok=True)
            with suppress(OSError):  # something else is in it
                self.out.rmdir()

    def _create(self, *, overwrite: bool) -> _WholeWrites:
        if self.file != self.out:
            self.out.mkdir(exist_ok=overwrite)
            (self.out / METADATA_FILE).unlink(missing_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (os.O_TRUNC if overwrite else os.O_EXCL)
        return _WholeWrites(os.open(self.file, flags, 0o644))

    def _channel(self, topic: Topic, source: bytes) -> int:
        known = self._channels.get((topic.key, source))
        if known is not None:
            return known
        if source and len(self._channels) >= MOST_PUBLISHERS:
            return self._channel(topic, b"")
        if topic.ros_type not in self._schemas:
            text = schema_text(topic.ros_type).encode()
            self._schemas[topic.ros_type] = self._writer.register_schema(topic.ros_type, SCHEMA_ENCODING, text)
        channel: int = self._writer.register_channel(
            channel_topic(self._namespace, topic),
            MESSAGE_ENCODING,
            self._schemas[topic.ros_type],
            channel_metadata(topic, source),
        )
        self._channels[topic.key, source] = channel
        return channel

    def _mark(self) -> None:
        """Note that the file ends with a whole record."""
        self._whole = self._stream.offset

    def _failed(self, error: OSError) -> RecordingError:
        self._failure = True
        self._stream.cut_back(self._whole)
        self._stream.close()
        return RecordingError(
            f"{self.file}: cannot be written any more: {error.strerror}; the {self._whole / 1e6:.1f} MB before are kept"
        )


class _WholeWrites:
    """A file that writes all it is given or raises; what Python buffers would be written again when it is closed."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.offset = 0

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            written = os.write(self._descriptor, left)
            self.offset += written
            left = left[written:]
        return len(data)

    def tell(self) -> int:
        return self.offset

    def flush(self) -> None:
        """Nothing is held back here."""

    def sync(self) -> None:
        os.fdatasync(self._descriptor)

    def cut_back(self, length: int) -> None:
        if self._descriptor < 0:
            return
        try:
            os.ftruncate(self._descriptor, length)
        except OSError:
            return  # not a plain file; readers stop at the first record that is not whole
        self.offset = length

    def close(self) -> None:
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            os.close(descriptor)
