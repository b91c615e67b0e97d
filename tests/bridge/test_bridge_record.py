"""What was recorded comes back as it was, whatever ended the recording."""

from __future__ import annotations

import random
import threading
from pathlib import Path

import pytest
from bridge_recordings import NAMESPACE, START_NS, Event, keypoints, walk, write, write_slowly
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bridge.cli import main
from bridge.clock import ManualClock
from bridge.codec import encode
from bridge.errors import ConfigError, SourceError
from bridge.messages import Keypoints
from bridge.outbox import Outbox
from bridge.record.reader import Recording
from bridge.record.recorder import OVERHEAD_BYTES, Recorder
from bridge.record.roles import inputs, outputs, parse_roles, parse_topics
from bridge.record.writer import BagWriter, RecordingError
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, TOPICS, TWIST, WRENCH, Topic
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub

EVENTS = walk(2.0)


class Cut:
    """A recording and how many messages were in it at each flush."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "whole.mcap"
        writer = BagWriter(self.path, NAMESPACE, TOPICS)
        self.flushed: list[tuple[int, int]] = []  # bytes, messages
        for count in write_slowly(writer, EVENTS):
            writer.flush()
            self.flushed.append((self.path.stat().st_size, count))
        writer.finish()
        self.bytes = self.path.read_bytes()

    def at_least(self, size: int) -> int:
        return max((count for written, count in self.flushed if written <= size), default=0)


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Cut:
    return Cut(tmp_path_factory.mktemp("cut"))


def read(path: Path) -> list[tuple[Topic, Sample]]:
    return [(recorded.topic, recorded.sample) for recorded in Recording(path).samples()]


def expected(events: list[Event]) -> list[tuple[Topic, Sample]]:
    return [(event.topic, event.sample) for event in events]


def test_samples_come_back_as_they_were(tmp_path: Path) -> None:
    path = write(tmp_path / "walk.mcap", EVENTS)
    assert read(path) == expected(EVENTS)
    recording = Recording(path)
    assert all(recorded.publish_time_ns == recorded.sample.arrival_ns - 300_000 for recorded in recording.samples())
    assert (recording.damage, recording.namespace, recording.progress) == ("", NAMESPACE, 1.0)
    assert recording.listened == tuple(topic.key for topic in TOPICS)


def test_samples_come_in_order_of_arrival(tmp_path: Path) -> None:
    shuffled = EVENTS.copy()
    for start in range(0, len(shuffled), 50):
        part = shuffled[start : start + 50]
        random.Random(start).shuffle(part)
        shuffled[start : start + 50] = part
    found = read(write(tmp_path / "shuffled.mcap", shuffled))
    times = [sample.arrival_ns for _, sample in found]
    assert times == sorted(times)
    assert sorted((topic.key, sample) for topic, sample in found) == sorted((e.topic.key, e.sample) for e in EVENTS)


def test_messages_are_decoded_and_what_does_not_decode_is_counted(tmp_path: Path) -> None:
    stamp = EVENTS[-1].sample.arrival_ns
    garbage = Event(KEYPOINTS, keypoints(stamp), Sample(b"\x00\x01\x00\x00nonsense", 99, b"x" * 16, stamp))
    recording = Recording(write(tmp_path / "walk.mcap", [*EVENTS, garbage]))
    found = list(recording.messages())
    assert recording.undecodable == 1
    assert [(topic, time) for topic, _, time in found] == [
        (event.topic, event.sample.arrival_ns) for event in EVENTS if event.topic != TWIST
    ]
    assert all(encode(topic, message) for topic, message, _ in found)
    only = [message for _, message, _ in recording.messages([KEYPOINTS])]
    assert all(isinstance(message, Keypoints) for message in only)
    assert len(only) == 60


def test_a_sample_without_number_stays_without(tmp_path: Path) -> None:
    sample = Sample(encode(KEYPOINTS, keypoints(START_NS)), -1, b"", START_NS)
    assert read(write(tmp_path / "foreign.mcap", [Event(KEYPOINTS, keypoints(START_NS), sample)])) == [
        (KEYPOINTS, sample)
    ]


def test_a_flood_of_publishers_shares_channels(tmp_path: Path) -> None:
    payload = encode(KEYPOINTS, keypoints(START_NS))
    sources = [number.to_bytes(16, "little") for number in range(3000)]
    events = [
        Event(KEYPOINTS, keypoints(START_NS), Sample(payload, 5, source, START_NS + index))
        for index, source in enumerate(sources)
    ]
    found = list(Recording(write(tmp_path / "flood.mcap", events)).samples())
    assert len(found) == 3000
    assert len({recorded.sample.source for recorded in found}) == 1025


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 1.0))
def test_cut_off_anywhere_what_was_flushed_is_there(cut: Cut, tmp_path: Path, share: float) -> None:
    size = max(8, round(share * len(cut.bytes)))
    part = tmp_path / "part.mcap"
    part.write_bytes(cut.bytes[:size])
    recording = Recording(part)
    found = [(recorded.topic, recorded.sample) for recorded in recording.samples()]
    assert found == expected(EVENTS)[: len(found)]
    assert len(found) >= cut.at_least(size)
    assert ("cut off" in recording.damage) == (size < len(cut.bytes))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_a_damaged_byte_never_becomes_a_message(cut: Cut, tmp_path: Path, place: float, flip: int) -> None:
    damaged = bytearray(cut.bytes)
    damaged[8 + int(place * (len(damaged) - 8))] ^= flip
    part = tmp_path / "damaged.mcap"
    part.write_bytes(damaged)
    try:
        found = [(recorded.topic, recorded.sample) for recorded in Recording(part).samples()]
    except SourceError:
        return
    whole = {(topic.key, sample) for topic, sample in expected(EVENTS)}
    assert {(topic.key, sample) for topic, sample in found} <= whole


def test_a_folder_is_a_rosbag2_folder(tmp_path: Path) -> None:
    out = write(tmp_path / "walk", EVENTS)
    assert sorted(file.name for file in out.iterdir()) == ["metadata.yaml", "walk_0.mcap"]
    assert read(out) == expected(EVENTS)


@pytest.mark.parametrize("name", ["taken.mcap", "taken"])
def test_a_taken_name_is_refused_unless_told(tmp_path: Path, name: str) -> None:
    out = write(tmp_path / name, EVENTS[:100])
    before = Recording(out).files[0].read_bytes()
    with pytest.raises(RecordingError, match="name is taken; --force"):
        BagWriter(out, NAMESPACE, TOPICS)
    assert Recording(out).files[0].read_bytes() == before
    writer = BagWriter(out, NAMESPACE, TOPICS, overwrite=True)
    writer.write(EVENTS[0].topic, EVENTS[0].sample)
    writer.finish()
    assert read(out) == expected(EVENTS[:1])


@pytest.mark.parametrize("place", ["nowhere/walk.mcap", "file/walk.mcap", "/proc/walk.mcap", "/proc/walk"])
def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="walk") as caught:
        BagWriter(tmp_path / place, NAMESPACE, TOPICS)
    assert "\n" not in str(caught.value)


def test_a_full_disk_is_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "full.mcap").symlink_to("/dev/full")
    with pytest.raises(RecordingError, match=r"full\.mcap: cannot be written any more: No space left"):
        BagWriter(tmp_path / "full.mcap", NAMESPACE, TOPICS, overwrite=True)


@pytest.mark.parametrize(
    ("content", "what"), [(None, "no such file"), (b"", "not an MCAP"), (b"PK\x03\x04 and more", "not an MCAP")]
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes | None, what: str) -> None:
    path = tmp_path / "file.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SourceError, match=f"file.mcap: {what}"):
        Recording(path)


def test_an_empty_folder_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"no \.mcap file in this folder"):
        Recording(tmp_path)


def test_two_robots_in_one_file_are_not_mixed(tmp_path: Path) -> None:
    for name in ("one", "two"):
        writer = BagWriter(tmp_path / f"{name}.mcap", name, TOPICS)
        writer.write(EVENTS[0].topic, EVENTS[0].sample)
        writer.finish()
    with pytest.raises(SourceError, match="two robots, one and two"):
        list(Recording(tmp_path).samples())


def test_an_empty_recording_reads_as_empty(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "empty.mcap", NAMESPACE, TOPICS)
    assert read(tmp_path / "empty.mcap") == []
    writer.finish()
    recording = Recording(tmp_path / "empty.mcap")
    assert list(recording.samples()) == []
    assert recording.damage == ""


class Wire:
    """An in-memory wire with a publisher of keypoints."""

    def __init__(self) -> None:
        self.clock = ManualClock(START_NS)
        self.hub = MemoryHub(self.clock)
        self.outbox = Outbox(self.hub.transport(), KEYPOINTS)
        self.sent_ns: list[int] = []

    def send(self, count: int) -> None:
        for _ in range(count):
            self.sent_ns.append(self.clock.now_ns())
            self.outbox.send(keypoints(self.clock.now_ns()))
            self.clock.advance(1 / 30)


def test_the_recorder_keeps_all_it_was_sent(tmp_path: Path) -> None:
    wire = Wire()
    recorder = Recorder(wire.hub.transport(), TOPICS, BagWriter(tmp_path / "a.mcap", NAMESPACE, TOPICS))
    wire.send(300)
    recorder.close()
    wire.send(1)  # nobody listens any more
    found = [recorded.sample for recorded in Recording(tmp_path / "a.mcap").samples()]
    assert [sample.sequence for sample in found] == list(range(300))
    assert [sample.arrival_ns for sample in found] == wire.sent_ns[:300]
    assert not recorder.dropped


class StuckWriter(BagWriter):
    """A disk that hangs until let go."""

    def __init__(self, out: Path) -> None:
        super().__init__(out, NAMESPACE, TOPICS)
        self.reached, self.let_go = threading.Event(), threading.Event()

    def write(self, topic: Topic, sample: Sample) -> None:
        self.reached.set()
        assert self.let_go.wait(60)
        super().write(topic, sample)


def test_a_disk_that_hangs_costs_messages_not_memory(tmp_path: Path) -> None:
    wire = Wire()
    writer = StuckWriter(tmp_path / "stuck.mcap")
    size = len(encode(KEYPOINTS, keypoints(START_NS))) + OVERHEAD_BYTES
    recorder = Recorder(wire.hub.transport(), TOPICS, writer, queue_bytes=10 * size)
    wire.send(1)
    assert writer.reached.wait(60)
    wire.send(25)  # ten of them find room
    assert recorder.dropped == {"keypoints": 15}
    writer.let_go.set()
    recorder.close()
    assert [recorded.sample.sequence for recorded in Recording(writer.out).samples()] == list(range(11))


class FullWriter(BagWriter):
    """A disk that fills up at the first flush."""

    def flush(self) -> None:
        raise self._failed(OSError(28, "No space left on device"))


def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path: Path) -> None:
    wire = Wire()
    arrived: list[Sample] = []
    wire.hub.transport().subscribe(KEYPOINTS, arrived.append)
    writer = FullWriter(tmp_path / "full.mcap", NAMESPACE, TOPICS)
    recorder = Recorder(wire.hub.transport(), TOPICS, writer, flush_s=0.0)
    recorder._thread.join(60)
    wire.send(100)
    assert len(arrived) == 100
    assert recorder.dropped == {"keypoints": 100}
    with pytest.raises(RecordingError, match="No space left on device"):
        recorder.close()
    assert list(Recording(writer.out).samples()) == []


def test_names_of_roles_and_topics() -> None:
    assert parse_topics("odom, keypoints") == (KEYPOINTS, ODOMETRY)
    with pytest.raises(ConfigError, match="--topics odometry: no such topic; known: keypoints, "):
        parse_topics("odometry")
    assert parse_roles("controller,anticipation") == ("anticipation", "controller")
    for bad, what in (("control", "no such role"), ("perception", "reads no recorded topic"), ("", "no such role")):
        with pytest.raises(ConfigError, match=what):
            parse_roles(bad)


def test_what_a_role_makes_is_not_fed_to_the_next() -> None:
    assert inputs(["controller"]) == (FALL_HORIZON, WRENCH, ODOMETRY)
    assert inputs(["anticipation", "controller"]) == (KEYPOINTS, WRENCH, ODOMETRY)
    assert outputs(["anticipation", "controller"]) == (FALL_HORIZON, SUPPORT_COMMAND, TWIST)


def test_synthetic_messages_are_acceptable() -> None:
    for event in EVENTS:
        event.message.check()


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--out", "taken.mcap"], "taken.mcap: the name is taken; --force replaces it"),
        (["--out", "nowhere/walk.mcap"], "no such folder: nowhere"),
        (["--out", "walk.mcap", "--topics", "odometry"], "--topics odometry: no such topic"),
        (["--out", "walk.mcap", "--set", "bridge.lease_ms=1"], "lease_ms"),
    ],
)
def test_the_command_refuses_in_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    what: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken.mcap").write_text("somebody's")
    assert main(["record", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert what in error
    assert [path.name for path in tmp_path.iterdir()] == ["taken.mcap"]
    assert Path("taken.mcap").read_text() == "somebody's"


def test_the_command_ends_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["record", "--duration", "0", "--topics", "wrench", "--set", "bridge.endpoints={}"]) == 0
    assert "0 messages" in capsys.readouterr().err
    (out,) = (tmp_path / "runs").iterdir()
    assert Recording(out).listened == ("wrench",)
