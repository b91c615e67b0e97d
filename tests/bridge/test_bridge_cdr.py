"""What we write is, byte for byte, what rosbags writes for the same message."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fuzz.corpus import corpus
from bridge.codec import TYPES, decode, encode
from bridge.messages import GaitState, NodeStatus, SupportCommand
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, SUPPORT_COMMAND, TOPICS, TWIST, Topic

DECODERS = list({topic.ros_type: topic for topic in TOPICS}.values())
text = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


def as_rosbags_writes(topic: Topic, payload: bytes) -> bytes:
    return bytes(TYPES.serialize_cdr(TYPES.deserialize_cdr(payload, topic.ros_type), topic.ros_type))


@pytest.mark.parametrize("topic", DECODERS, ids=lambda topic: topic.ros_type)
def test_every_type_of_message(topic: Topic) -> None:
    for payload in corpus(topic):
        assert payload == as_rosbags_writes(topic, payload)


@settings(max_examples=100, deadline=None)
@given(frame=text, reason=text, solver=text, state=st.sampled_from(list(GaitState)), sequence=st.integers(0, 2**64 - 1))
def test_texts_of_any_length_and_alphabet(
    frame: str, reason: str, solver: str, state: GaitState, sequence: int
) -> None:
    message: SupportCommand = replace(
        decode(SUPPORT_COMMAND, corpus(SUPPORT_COMMAND)[1]), frame_id=frame, reason=reason, solver=solver, state=state
    )
    payload = encode(SUPPORT_COMMAND, message, sequence)
    assert payload == as_rosbags_writes(SUPPORT_COMMAND, payload)
    back = decode(SUPPORT_COMMAND, payload)
    assert (back.frame_id, back.reason, back.solver, back.state) == (frame, reason, solver, state)
    assert back.sequence == sequence
    twist = encode(TWIST, message)
    assert twist == as_rosbags_writes(TWIST, twist)


@settings(max_examples=60, deadline=None)
@given(role=text, summary=text, values=st.dictionaries(text, text, max_size=6), level=st.integers(0, 3))
def test_statuses_with_any_pairs(role: str, summary: str, values: dict[str, str], level: int) -> None:
    status = NodeStatus(stamp_ns=1_700_000_000_123_456_789, role=role, level=level, summary=summary, values=values)
    payload = encode(DIAGNOSTICS, status)
    assert payload == as_rosbags_writes(DIAGNOSTICS, payload)
    back = decode(DIAGNOSTICS, payload)
    assert (back.role, back.summary, back.values, back.level) == (role, summary, values, level)


def test_an_array_in_another_order_is_written_row_by_row() -> None:
    horizon = decode(FALL_HORIZON, corpus(FALL_HORIZON)[1])
    turned = replace(horizon, plane=np.asfortranarray(horizon.plane), centre_distance=horizon.centre_distance[::-1])
    back = decode(FALL_HORIZON, encode(FALL_HORIZON, turned))
    assert np.array_equal(back.plane, horizon.plane)
    assert np.array_equal(back.centre_distance, horizon.centre_distance[::-1])


def test_a_number_of_its_own_or_one_that_is_given() -> None:
    message = decode(FALL_HORIZON, corpus(FALL_HORIZON)[1])
    assert decode(FALL_HORIZON, encode(FALL_HORIZON, message)).sequence == message.sequence
    assert decode(FALL_HORIZON, encode(FALL_HORIZON, message, 77)).sequence == 77
