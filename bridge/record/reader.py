"""Reading recordings, whole or cut off, in the order in which the messages arrived."""

from __future__ import annotations

import heapq
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from mcap.exceptions import McapError, UnsupportedCompressionError
from mcap.records import Channel, Chunk, Footer, McapRecord, Metadata, Schema
from mcap.records import Message as Record
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from bridge.codec import decode
from bridge.errors import InvalidMessage, SourceError
from bridge.messages import Message
from bridge.record.layout import (
    ABOUT,
    MESSAGE_ENCODING,
    SUFFIX,
    has_present_definition,
    source_of,
    split_channel_topic,
)
from bridge.topics import TOPICS, TWIST, Topic
from bridge.transport.interface import Sample

REORDERED: Final = 1024  # messages that may lie between where one is in the file and where its time puts it
RECORD_LIMIT: Final = 256 << 20  # a longer record is damage, not data [bytes]

_MAGIC = b"\x89MCAP0\r\n"
# what mcap, zstandard and lz4 (RuntimeError) raise on bytes that are not what they should be
_DAMAGE = (McapError, struct.error, ZstdError, RuntimeError, ValueError, EOFError, OverflowError, MemoryError)
_Keyed = tuple[int, int, "Recorded"]


class Recorded(NamedTuple):
    """One message as it arrived at the recorder."""

    topic: Topic
    sample: Sample  # arrival_ns is the recorder's time; sequence -1 where the publisher is not known
    publish_time_ns: int  # stamp of the message's header

    @property
    def log_time_ns(self) -> int:
        """When it arrived at the recorder [ns since the epoch]."""
        return self.sample.arrival_ns


class Recording:
    """A recording: an `.mcap` file, or a rosbag2 folder of them.

    Each call of `samples` or `messages` reads from the start. After one was read to its end,
    `damage` says in words what is wrong with the file, '' for nothing.

    Raises:
        SourceError: there is no such file, or it is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files = _files(path)
        for file in self.files:
            _require_mcap(file)
        self.listened = _listened(self.files[0])  # keys the recorder subscribed to; empty if it does not say
        self.damage = ""
        self.undecodable = 0  # messages that `messages` could not decode
        self.foreign: dict[tuple[str, str], int] = {}  # (topic, type) -> messages of channels that are not ours
        self.namespace = ""
        self._size = max(sum(file.stat().st_size for file in self.files), 1)
        self._read = 0

    @property
    def progress(self) -> float:
        """How much of the recording was read, 0..1."""
        return min(self._read / self._size, 1.0)

    def samples(self, topics: Collection[Topic] = TOPICS) -> Iterator[Recorded]:
        """Give every message of `topics` as bytes, ordered by time of arrival.

        Raises:
            SourceError: the file cannot be read, or holds topics of several robots.
        """
        waiting: list[_Keyed] = []
        for index, recorded in enumerate(self._in_file_order(frozenset(topic.key for topic in topics))):
            heapq.heappush(waiting, (recorded.sample.arrival_ns, index, recorded))
            if len(waiting) > REORDERED:
                yield heapq.heappop(waiting)[2]
        while waiting:
            yield heapq.heappop(waiting)[2]

    def messages(self, topics: Collection[Topic] = TOPICS) -> Iterator[tuple[Topic, Message, int]]:
        """Give topic, message and time of arrival [ns] of every message of `topics` that decodes.

        `cmd_vel` repeats `support_command` for foreign bases and is left out. Values are not
        judged here (see `Message.check`).
        """
        self.undecodable = 0
        for recorded in self.samples([topic for topic in topics if topic != TWIST]):
            try:
                message = decode(recorded.topic, recorded.sample.payload, max(recorded.sample.sequence, 0))
            except InvalidMessage:
                self.undecodable += 1
                continue
            yield recorded.topic, message, recorded.sample.arrival_ns

    def _in_file_order(self, keys: Collection[str]) -> Iterator[Recorded]:
        self.damage, self._read, self.foreign, self.namespace = "", 0, {}, ""
        damages: list[str] = []
        others: Counter[tuple[str, str]] = Counter()
        for file in self.files:
            before = self._read
            scan = _Scan(file)
            with closing(scan):
                channels: dict[int, _Channel] = {}
                for record in scan.records():
                    if isinstance(record, Channel):
                        channels[record.id] = self._channel(record, scan.schemas.get(record.schema_id, ""))
                    elif isinstance(record, Record) and record.channel_id in channels:
                        channel = channels[record.channel_id]
                        if channel.other:
                            others[channel.name] += 1
                        elif channel.topic is None:
                            self.foreign[channel.name] = self.foreign.get(channel.name, 0) + 1
                        elif channel.topic.key in keys:
                            self._read = before + scan.position
                            sequence = record.sequence if channel.source else -1
                            sample = Sample(record.data, sequence, channel.source, record.log_time)
                            yield Recorded(channel.topic, sample, record.publish_time)
                damages += [f"{file.name} {damage}" if len(self.files) > 1 else damage for damage in scan.damages()]
            self._read = before + file.stat().st_size
        damages += [
            f"{count} messages of {name} were left out, whose {ros_type} is not the one of this version"
            for (name, ros_type), count in others.items()
        ]
        self.damage = "; ".join(damages)

    def _channel(self, record: Channel, ros_type: str) -> _Channel:
        found = split_channel_topic(record.topic, ros_type) if record.message_encoding == MESSAGE_ENCODING else None
        if found is None:
            return _Channel((record.topic, ros_type), None, b"", other=False)
        namespace, topic = found
        if self.namespace and namespace != self.namespace:
            raise SourceError(f"{self.path}: holds topics of two robots, {self.namespace} and {namespace}")
        self.namespace = namespace
        other = not has_present_definition(topic, record.metadata)
        return _Channel((record.topic, ros_type), topic, source_of(record.metadata), other)


class _Channel(NamedTuple):
    name: tuple[str, str]  # topic, type
    topic: Topic | None  # None: not one of ours
    source: bytes
    other: bool  # one of ours, whose messages are laid out as another version has them


class _Scan:
    """The records of one file from its start, as far as they are whole; needs no index."""

    def __init__(self, file: Path) -> None:
        self.schemas: dict[int, str] = {}  # id -> type
        self._file = file
        self._damaged_chunks = 0
        self._cut_off_at: int | None = None
        try:
            self._stream: BinaryIO = file.open("rb")
        except OSError as error:
            raise SourceError(f"{file}: cannot be read: {error.strerror}") from error

    @property
    def position(self) -> int:
        """How far the file was read [bytes]."""
        return self._stream.tell()

    def records(self) -> Iterator[McapRecord]:
        """Give the records in the file's order, those inside chunks too."""
        records = StreamReader(self._stream, emit_chunks=True, record_size_limit=RECORD_LIMIT).records
        whole = 0  # where the last whole record ends
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            except OSError as error:
                raise SourceError(f"{self._file}: cannot be read: {error.strerror}") from error
            except _DAMAGE:
                self._cut_off_at = whole
                return
            if isinstance(record, Footer):  # what follows is the closing magic, and repeats of what was read
                self._cut_off_at = None if self._ends_well() else self.position
                return
            if isinstance(record, Chunk):  # whole: a record that the file's end cuts short raises
                yield from self._inside(record)
            else:
                if isinstance(record, Schema):
                    self.schemas[record.id] = record.name
                yield record
            whole = self.position

    def damages(self) -> list[str]:
        """Return what is wrong with the file, in words."""
        found = []
        if self._damaged_chunks:
            found.append(f"{self._damaged_chunks} damaged chunks were skipped")
        if self._cut_off_at is not None:
            found.append(f"cut off after {self._cut_off_at} bytes; everything before was recovered")
        return found

    def close(self) -> None:
        self._stream.close()

    def _inside(self, chunk: Chunk) -> list[McapRecord]:
        try:
            records = breakup_chunk(chunk, validate_crc=True)
        except UnsupportedCompressionError as error:
            raise SourceError(f"{self._file}: {error}") from error
        except _DAMAGE:
            self._damaged_chunks += 1
            return []
        for record in records:
            if isinstance(record, Schema):
                self.schemas[record.id] = record.name
        return records

    def _ends_well(self) -> bool:
        return self._stream.read(len(_MAGIC)) == _MAGIC


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = sorted(path.glob(f"*{SUFFIX}"), key=lambda file: (len(file.name), file.name))
        if not files:
            raise SourceError(f"{path}: no {SUFFIX} file in this folder")
        return files
    if not path.exists():
        raise SourceError(f"{path}: no such file")
    return [path]


def _listened(file: Path) -> tuple[str, ...]:
    """Return what the metadata record behind the header says was listened to."""
    with closing(_Scan(file)) as scan:
        for record in islice(scan.records(), 2):
            if isinstance(record, Metadata) and record.name == ABOUT:
                return tuple(filter(None, record.metadata.get("topics", "").split(",")))
    return ()


def _require_mcap(file: Path) -> None:
    try:
        with file.open("rb") as stream:
            magic = stream.read(len(_MAGIC))
    except OSError as error:
        raise SourceError(f"{file}: cannot be read: {error.strerror}") from error
    if magic != _MAGIC:
        raise SourceError(f"{file}: not an MCAP file")
