"""`surefoot info` tells what was in the recording, whole or not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bridge_recordings import NAMESPACE, SOURCES, START_NS, Event, keypoints, walk, write, write_slowly

from bridge.cli import main
from bridge.clock import NS
from bridge.codec import encode
from bridge.record import layout
from bridge.record.info import RecordingInfo, summarise
from bridge.record.reader import Recording
from bridge.record.writer import BagWriter
from bridge.topics import DIAGNOSTICS, KEYPOINTS, ODOMETRY, TOPICS
from bridge.transport.interface import Sample


def numbered(numbers: list[int], source: bytes = b"a" * 16, age_ns: int = 5_000_000) -> list[Event]:
    """Keypoints with these numbers, one every 100 ms."""
    events = []
    for index, number in enumerate(numbers):
        arrival_ns = START_NS + index * NS // 10
        message = keypoints(arrival_ns - age_ns)
        events.append(Event(KEYPOINTS, message, Sample(encode(KEYPOINTS, message), number, source, arrival_ns)))
    return events


def info_of(path: Path) -> RecordingInfo:
    return summarise(Recording(path))


def test_counts_rates_gaps_and_ages(tmp_path: Path) -> None:
    found = info_of(write(tmp_path / "walk.mcap", walk(2.0)))
    assert (found.damage, found.messages, found.foreign) == ("", sum(t.messages for t in found.topics), {})
    by_name = {topic.topic: topic for topic in found.topics}
    assert set(by_name) == {f"/surefoot/{topic.key}" for topic in TOPICS}
    for topic in TOPICS:
        row = by_name[f"/surefoot/{topic.key}"]
        assert row.type == topic.ros_type
        assert row.age_p50_ms == pytest.approx(0.3)
        assert (row.missing, row.disordered) == (0, 0)
        if topic != DIAGNOSTICS:
            assert row.rate_hz == pytest.approx(topic.rate_hz, rel=1e-3)
            assert row.largest_gap_s == pytest.approx(1 / topic.rate_hz, rel=1e-3)
    assert by_name["/surefoot/diagnostics"].publishers == 4


def test_skipped_and_disordered_numbers_are_counted_per_publisher(tmp_path: Path) -> None:
    one = numbered([4, 5, 8, 7, 9])
    other = numbered([100, 104], source=b"b" * 16)
    (topic,) = info_of(write(tmp_path / "gaps.mcap", [*one, *other], (KEYPOINTS,))).topics
    assert (topic.publishers, topic.missing, topic.disordered) == (2, 2 + 3, 1)
    assert topic.age_max_ms == pytest.approx(5.0)


def test_a_silent_topic_is_listed(tmp_path: Path) -> None:
    found = info_of(write(tmp_path / "silent.mcap", numbered([0, 1]), (KEYPOINTS, ODOMETRY)))
    assert [(topic.topic, topic.messages) for topic in found.topics] == [
        ("/surefoot/keypoints", 2),
        ("/surefoot/odom", 0),
    ]


@pytest.fixture
def truncated(tmp_path: Path) -> Path:
    path = tmp_path / "cut.mcap"
    writer = BagWriter(path, NAMESPACE, TOPICS)
    for _ in write_slowly(writer, walk(2.0)):
        writer.flush()
    path.write_bytes(path.read_bytes()[:-6000])
    return path


def test_a_file_that_was_cut_off_is_read_and_said(truncated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(truncated)]) == 0
    out = capsys.readouterr().out
    assert "not whole: cut off after" in out
    assert "recovered" in out
    assert main(["info", str(truncated), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["whole"] is False
    assert 1.4 < found["duration_s"] < 1.6


def test_messages_that_another_version_laid_out_otherwise_are_left_out_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their bytes would be read as other fields than they are."""
    true = layout.TYPES.hash_rihs01
    old = "RIHS01_" + "0" * 64
    with monkeypatch.context() as before:
        before.setattr(layout.TYPES, "hash_rihs01", lambda name: old if name == KEYPOINTS.ros_type else true(name))
        path = write(tmp_path / "old.mcap", walk(0.5))
    recording = Recording(path)
    found = summarise(recording)
    assert found.damage == (
        f"15 messages of /surefoot/keypoints were left out, whose {KEYPOINTS.ros_type} is not the one of this version;"
        f" 15 messages of /surefoot/detections were left out, whose {KEYPOINTS.ros_type} is not the one of this version"
    )
    counts = {topic.topic: topic.messages for topic in found.topics}
    assert counts["/surefoot/keypoints"] == 0
    assert counts["/surefoot/odom"] == 50
    assert KEYPOINTS not in {topic for topic, _, _ in recording.messages()}
    assert main(["info", str(path)]) == 0
    assert "15 messages of /surefoot/keypoints were left out" in capsys.readouterr().out


def test_json_has_no_nan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "silent.mcap", numbered([3]), (KEYPOINTS, ODOMETRY))
    assert main(["info", str(path), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert found["whole"] is True
    assert found["topics"][0]["rate_hz"] is None
    assert found["topics"][1]["age_p50_ms"] is None


def test_the_table_has_a_line_for_each_topic(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(write(tmp_path / "walk", walk(1.0)))]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "messages in" in lines[0]
    assert [line.split()[0] for line in lines[3:]] == [f"/surefoot/{topic.key}" for topic in TOPICS]


@pytest.mark.parametrize("name", ["missing.mcap", "text.mcap"])
def test_what_is_no_recording_is_one_line(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "text.mcap").write_text("not a recording")
    assert main(["info", str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert name in error


def test_sources_of_the_walk_differ() -> None:
    assert len(set(SOURCES.values())) == 4
