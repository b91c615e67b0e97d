"""A part of `make fuzz`: nothing but a refusal comes out of a decoder, and nothing invalid through it."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from benchmarks.fuzz.corpus import corpus
from benchmarks.fuzz.mutations import Mutator
from benchmarks.fuzz.reference import Malformed, parse, wrong
from benchmarks.fuzz.run import fuzz
from bridge.codec import decode, encode
from bridge.errors import InvalidMessage
from bridge.messages import Wrench
from bridge.topics import KEYPOINTS, TOPICS, TWIST, WRENCH, Topic

DECODERS = list({topic.ros_type: topic for topic in TOPICS}.values())
READ = [topic for topic in DECODERS if topic is not TWIST]


@pytest.mark.parametrize("topic", DECODERS, ids=lambda topic: topic.ros_type)
def test_mutated_payloads_are_refused_or_valid(topic: Topic) -> None:
    found = fuzz(topic, corpus(topic), 3_000, seed=11)
    assert found.crashes == []
    assert found.accepted_invalid == {}
    assert found.refused > 300
    assert found.accepted > 300 or topic is TWIST
    assert not found.failed


@pytest.mark.parametrize("topic", READ, ids=lambda topic: topic.ros_type)
def test_the_reference_agrees_on_what_is_valid(topic: Topic) -> None:
    """So that the fuzzer finds fault with the decoder and not with its own reference."""
    for payload in corpus(topic):
        message = decode(topic, payload)
        try:
            message.check()
            refused = ""
        except InvalidMessage as error:
            refused = str(error)
        assert bool(wrong(topic.ros_type, parse(topic.ros_type, payload))) == bool(refused), refused


def test_the_reference_would_notice_a_decoder_that_lets_things_through(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Wrench, "check", lambda self: None)
    found = fuzz(WRENCH, corpus(WRENCH), 2_000, seed=3)
    assert set(found.accepted_invalid) & {"force beyond -5000..5000", "torque beyond -2000..2000"}
    assert found.failed


@pytest.mark.parametrize(
    "spoil",
    [
        lambda p: p[:-9],
        lambda p: p + bytes(8),
        lambda p: b"\x00\x02" + p[2:],
        lambda p: p[:12] + b"\xff\xff\xff\x7f" + p[16:],
        lambda p: p[:8] + b"\xff\xff\xff\xff" + p[12:],
    ],
    ids=["cut", "longer", "encapsulation", "string length", "nanoseconds"],
)
@pytest.mark.parametrize("topic", READ, ids=lambda topic: topic.ros_type)
def test_both_refuse_what_is_broken(topic: Topic, spoil) -> None:
    payload = spoil(corpus(topic)[1])
    with pytest.raises(InvalidMessage):
        decode(topic, payload).check()
    with contextlib.suppress(Malformed):
        assert wrong(topic.ros_type, parse(topic.ros_type, payload))


def test_a_flag_is_zero_or_one() -> None:
    payload = corpus(KEYPOINTS)[1]
    at = payload.index(b"camera\x00") + 8 + (-(payload.index(b"camera\x00") + 8 - 4) % 8) + 8
    at = next(k for k in (at, at - 1, at + 1, at - 8, at + 7) if payload[k] == 1)
    for flag in (2, 0x80, 0xFF):
        with pytest.raises(InvalidMessage, match=f"valid is {flag}, limits 0..1"):
            decode(KEYPOINTS, payload[:at] + bytes([flag]) + payload[at + 1 :])


def test_the_same_seed_gives_the_same_payloads() -> None:
    first, again, other = (Mutator(corpus(WRENCH), seed) for seed in (1, 1, 2))
    payloads = [first.next() for _ in range(50)]
    assert payloads == [again.next() for _ in range(50)]
    assert payloads != [other.next() for _ in range(50)]


def test_big_endian_writers_are_read() -> None:
    """CDR leaves the order to the writer; the reference reads both, and so must we."""
    good = decode(WRENCH, corpus(WRENCH)[0])
    raw = encode(WRENCH, good)
    assert raw[1] == 1
    text = len(good.frame_id) + 1
    body = raw[4:]
    swapped = body[3::-1] + body[7:3:-1] + body[11:7:-1] + body[12 : 12 + text]
    doubles = body[-48:]
    pad = bytes(-len(swapped) % 8)
    swapped += pad + b"".join(doubles[k : k + 8][::-1] for k in range(0, 48, 8))
    back = decode(WRENCH, b"\x00\x00\x00\x00" + swapped)
    assert np.array_equal(back.force, good.force)
    assert back.stamp_ns == good.stamp_ns
