"""What is refused is said, once when it is new and then now and then, whatever an attacker does."""

from __future__ import annotations

import logging
import re
from dataclasses import replace

import pytest
from bridge_recordings import START_NS, keypoints

from bridge.clock import NS, ManualClock
from bridge.codec import MAX_PAYLOAD_BYTES, encode
from bridge.inbox import Inbox
from bridge.messages import Keypoints
from bridge.refusals import MOST_KINDS, FloodWatch, Refusals
from bridge.topics import KEYPOINTS
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub


class Book:
    """A log of lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.refusals = Refusals(self.lines.append, period_s=5.0)


def test_the_first_is_said_at_once_and_the_rest_in_one_line() -> None:
    book = Book()
    for turn in range(1000):
        book.refusals.note(f"horizon is {turn} ms old", turn * 0.01)
    assert book.lines == ["refused: horizon is 0 ms old", "refused: horizon is 500 ms old (500 times in 5 s)"]
    book.refusals.sweep(20.0)
    assert book.lines[2] == "refused: horizon is 999 ms old (499 times in 15 s)"
    book.refusals.sweep(90.0)
    assert len(book.lines) == 3
    assert book.refusals.total == 1000


def test_different_things_are_told_apart() -> None:
    book = Book()
    for what in ("wrench is not finite", "odom is not finite"):
        book.refusals.note(what, 0.0)
    assert len(book.lines) == 2


def test_an_attacker_who_varies_his_words_fills_neither_log_nor_memory() -> None:
    book = Book()
    words = [chr(97 + number // 26) + chr(97 + number % 26) for number in range(600)]
    for word in words:
        book.refusals.note(f"key {word}", 0.0)
    assert len(book.lines) == MOST_KINDS + 1
    assert len(book.refusals._kinds) <= MOST_KINDS + 1
    assert book.refusals.total == 600


def test_a_flood_is_noticed_and_ten_times_the_usual_is_none() -> None:
    watch = FloodWatch("keypoints", 30.0)
    assert watch.judge(START_NS) == ""
    watch.arrived += 300
    assert watch.judge(START_NS + NS) == ""
    watch.arrived += 5000
    assert watch.judge(START_NS + NS + NS // 2) is None, "not before a second is over"
    assert "a flood, 5000 a second where 30 are usual" in (watch.judge(START_NS + 2 * NS) or "")
    assert watch.judge(START_NS + 3 * NS) == ""


class Reader:
    """An inbox of keypoints, and somebody who sends it bytes as he likes."""

    def __init__(self, caplog: pytest.LogCaptureFixture) -> None:
        self.clock, self.caplog = ManualClock(START_NS), caplog
        self.hub = MemoryHub(self.clock)
        self.inbox = Inbox[Keypoints](self.hub.transport(), KEYPOINTS)
        caplog.set_level(logging.WARNING, logger="bridge.inbox")

    def send(self, message: Keypoints, number: int, source: bytes = b"a" * 16) -> str:
        """Return the fault after the message was read."""
        self.hub.deliver(KEYPOINTS, Sample(encode(KEYPOINTS, message), number, source, self.clock.now_ns()))
        return self.inbox.read(self.clock.now_ns()).fault

    @property
    def said(self) -> list[str]:
        return [record.getMessage() for record in self.caplog.records]


@pytest.fixture
def reader(caplog: pytest.LogCaptureFixture) -> Reader:
    made = Reader(caplog)
    assert made.send(keypoints(START_NS), 7) == ""
    made.clock.advance(0.03)
    assert made.send(keypoints(made.clock.now_ns()), 8) == ""
    return made


def test_a_replayed_message_is_refused_and_said(reader: Reader) -> None:
    assert reader.send(keypoints(START_NS), 7) == "", "what was taken before is still good"
    (line,) = reader.said
    assert line == "refused: keypoints: number 7 after 8, an old message or a repeated one"
    assert reader.inbox.refused == 1


def test_what_is_no_longer_refused_is_still_counted_in_the_log(reader: Reader) -> None:
    for _ in range(3):
        reader.send(keypoints(START_NS), 7)
    for number in range(9, 16):
        reader.clock.advance(1.0)
        assert reader.send(keypoints(reader.clock.now_ns()), number) == ""
    first, rest = reader.said
    assert first.startswith("refused: keypoints: number 7 after 8")
    assert re.fullmatch(r"refused: keypoints: number 7 after 8, .* \(2 times in \d s\)", rest)


def test_a_replayed_message_under_another_name_is_refused_and_said(reader: Reader) -> None:
    reader.send(keypoints(START_NS), 99, source=b"b" * 16)
    assert reader.said == ["refused: keypoints: from a second publisher while the first lives"]
    reader.clock.advance(1.0)  # the first fell silent
    fault = reader.send(keypoints(START_NS), 100, source=b"b" * 16)
    assert "ms old, limit 150" in fault
    assert "stamped 30 ms before what was taken" in reader.said[-1]


def test_a_replay_to_a_reader_that_knows_nothing_yet_is_too_old(caplog: pytest.LogCaptureFixture) -> None:
    reader = Reader(caplog)
    assert "is 60000 ms old, limit 150" in reader.send(keypoints(START_NS - 60 * NS), 5)


def test_one_forged_number_silences_the_publisher_for_a_moment_only(reader: Reader) -> None:
    reader.clock.advance(0.01)
    assert reader.send(keypoints(reader.clock.now_ns()), 1 << 62) == ""
    faults = []
    for number in range(9, 24):
        reader.clock.advance(0.033)
        faults.append(reader.send(keypoints(reader.clock.now_ns()), number))
    assert any("ms old, limit" in fault for fault in faults) or reader.inbox.refused
    assert faults[-5:] == [""] * 5
    assert "number 9 after 4611686018427387904" in reader.said[0]


def test_an_oversized_message_is_refused_and_said(reader: Reader) -> None:
    payload = encode(KEYPOINTS, keypoints(reader.clock.now_ns())) + bytes(MAX_PAYLOAD_BYTES)
    reader.hub.deliver(KEYPOINTS, Sample(payload, 9, b"a" * 16, reader.clock.now_ns()))
    fault = reader.inbox.read(reader.clock.now_ns()).fault
    assert f"keypoints is {len(payload)} bytes, limit {MAX_PAYLOAD_BYTES}" in fault
    assert reader.said == [f"refused: keypoints: {fault}"]


def test_a_flood_is_said_and_the_newest_is_what_is_read(reader: Reader) -> None:
    for second in range(3):
        start = reader.clock.now_ns()
        for index in range(2000):
            stamp = start + index * 100_000
            message = keypoints(stamp)
            number = 9 + second * 2000 + index
            reader.hub.deliver(KEYPOINTS, Sample(encode(KEYPOINTS, message), number, b"a" * 16, stamp))
        reader.clock.advance(1.0)
        read = reader.inbox.read(reader.clock.now_ns())
        assert read.message is not None
        assert read.message.stamp_ns == start + 1999 * 100_000
    assert any(
        re.match(r"refused: keypoints: a flood, \d{4} a second where 30 are usual", line) for line in reader.said
    )


def test_what_is_wrong_with_values_is_said(reader: Reader) -> None:
    reader.clock.advance(0.03)
    bad = replace(keypoints(reader.clock.now_ns()), body_length_px=-1.0)
    assert "body_length_px" in reader.send(bad, 9)
    assert "body_length_px" in reader.said[0]
