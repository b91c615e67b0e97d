"""Messages survive the wire exactly, and what is not a message never becomes one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.codec import MAX_PAYLOAD_BYTES, OWN_TYPES, decode, encode, message_definition
from bridge.errors import InvalidMessage
from bridge.messages import (
    FallHorizon,
    GaitState,
    Keypoints,
    Message,
    NodeStatus,
    Odometry,
    SupportCommand,
    Wrench,
)
from bridge.topics import (
    DIAGNOSTICS,
    FALL_HORIZON,
    KEYPOINTS,
    ODOMETRY,
    SUPPORT_COMMAND,
    TOPICS,
    TWIST,
    WRENCH,
    Topic,
)

STAMP = 1_795_334_344_860_158_123
rng = np.random.default_rng(0)


def keypoints() -> Keypoints:
    position = rng.uniform(0, 300, (12, 2))
    position[3] = np.nan
    return Keypoints(
        stamp_ns=STAMP,
        sequence=7,
        position_px=position,
        confidence=rng.uniform(0, 1, 12),
        status=np.array([0, 1, 0, 2] + [0] * 8, np.uint8),
        body_length_px=81.25,
        image_width=320,
        image_height=240,
        people=2,
    )


def horizon() -> FallHorizon:
    return FallHorizon(
        stamp_ns=STAMP,
        sequence=8,
        probabilities=rng.dirichlet([1, 1, 1], 16),
        distance=rng.normal(size=16),
        distance_rate=rng.normal(size=16),
        time_to_boundary=np.full(16, np.inf),
        centre_distance=rng.uniform(0, 5, (16, 3)),
        plane=rng.normal(size=(16, 2)),
        forecast_px=rng.uniform(0, 300, (16, 12, 2)),
        quality=0.9,
    )


def command() -> SupportCommand:
    return SupportCommand(
        stamp_ns=STAMP,
        sequence=9,
        velocity=[0.1, -0.2, 0.3, -0.04],
        acceleration=[1, 2, 3, 4],
        column_height=0.9,
        stiffening=0.5,
        damping=[1, 2, 3, 4],
        stiffness=[5, 6, 7, 8],
        state=GaitState.ARREST,
        solver="mpc",
        lifetime_s=0.05,
        reason="fall boundary 0.4 sd away",
        rests_on_ns=STAMP - 5_000_000,
    )


EXAMPLES: list[tuple[Topic, Message]] = [
    (KEYPOINTS, keypoints()),
    (FALL_HORIZON, horizon()),
    (SUPPORT_COMMAND, command()),
    (WRENCH, Wrench(stamp_ns=STAMP, sequence=3, force=[1, -2, -300.5], torque=[0, 0.5, 0])),
    (
        ODOMETRY,
        Odometry(stamp_ns=STAMP, sequence=4, position=[1, 2, 0.95], yaw=2.9, velocity=[0.4, 0, 0], yaw_rate=-0.2),
    ),
    (DIAGNOSTICS, NodeStatus(stamp_ns=STAMP, role="controller", level=1, summary="late", values={"rate_hz": "99.7"})),
]


def same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if isinstance(a, float):
        return bool(np.isclose(a, b, rtol=1e-12, atol=1e-12, equal_nan=True))
    return a == b


@pytest.mark.parametrize(("topic", "message"), EXAMPLES, ids=lambda value: getattr(value, "key", ""))
def test_a_message_comes_back_as_it_was_sent(topic: Topic, message: Message) -> None:
    back = decode(topic, encode(topic, message), message.sequence)
    for field in dataclasses.fields(message):  # type: ignore[arg-type]
        assert same(getattr(message, field.name), getattr(back, field.name)), field.name
    back.check()


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.key)
def test_every_topic_has_an_encoder(topic: Topic) -> None:
    example = next(message for _, message in EXAMPLES if isinstance(message, topic.message))
    assert encode(topic, example)[:2] == b"\x00\x01"  # CDR, little-endian


def test_the_twist_for_foreign_bases_is_the_commands_twist() -> None:
    from bridge.codec import TYPES

    raw = TYPES.deserialize_cdr(encode(TWIST, command()), TWIST.ros_type)
    linear, angular = raw.twist.linear, raw.twist.angular
    assert [linear.x, linear.y, angular.z, linear.z] == command().velocity.tolist()


@pytest.mark.parametrize(("topic", "message"), EXAMPLES, ids=lambda value: getattr(value, "key", ""))
@settings(deadline=None, max_examples=150)
@given(data=st.data())
def test_broken_bytes_are_refused_or_read_whole(topic: Topic, message: Message, data: st.DataObject) -> None:
    payload = bytearray(encode(topic, message))
    cut = data.draw(st.integers(0, len(payload)))
    for _ in range(data.draw(st.integers(0, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        back = decode(topic, bytes(payload[:cut]))
    except InvalidMessage as error:
        assert topic.key in str(error) or "norm" in str(error) or "shape" in str(error)
        return
    assert isinstance(back, topic.message)


def test_an_oversized_payload_is_refused_unread() -> None:
    with pytest.raises(InvalidMessage, match=rf"{MAX_PAYLOAD_BYTES + 1} bytes, limit {MAX_PAYLOAD_BYTES}"):
        decode(WRENCH, b"\x00\x01" + bytes(MAX_PAYLOAD_BYTES - 1))


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (dataclasses.replace(EXAMPLES[3][1], force=[np.nan, 0, 0]), "wrench force is not finite"),  # type: ignore[type-var]
        (dataclasses.replace(EXAMPLES[3][1], force=[9e9, 0, 0]), "wrench force .* limits -5000..5000"),  # type: ignore[type-var]
        (dataclasses.replace(horizon(), probabilities=np.full((16, 3), 0.5)), "sum of horizon probabilities is 1.5"),
        (dataclasses.replace(horizon(), distance=np.full(16, np.nan)), "horizon distance is not finite"),
        (dataclasses.replace(horizon(), time_to_boundary=np.full(16, np.nan)), "time_to_boundary"),
        (dataclasses.replace(horizon(), valid=False, reason="no person"), "horizon is not valid: no person"),
        (dataclasses.replace(horizon(), quality=1.5), "quality is 1.5, limits 0..1"),
        (dataclasses.replace(keypoints(), status=np.zeros(12, np.uint8)), "keypoint position is not finite"),
        (dataclasses.replace(keypoints(), body_length_px=0.0), "body_length_px is 0"),
        (dataclasses.replace(command(), velocity=[0, 0, np.inf, 0]), "command velocity is not finite"),
        (dataclasses.replace(command(), stiffening=1.2), "stiffening is 1.2"),
    ],
)
def test_check_names_field_value_and_limit(message: Message, says: str) -> None:
    with pytest.raises(InvalidMessage, match=says):
        message.check()


def test_arrays_of_a_message_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="read-only"):
        horizon().distance[0] = 1.0


def test_wrong_shapes_never_become_a_message() -> None:
    with pytest.raises(InvalidMessage, match="force has shape"):
        Wrench(stamp_ns=0, force=[1, 2], torque=[0, 0, 0])


@pytest.mark.parametrize("name", OWN_TYPES)
def test_every_field_of_our_messages_says_what_it_is(name: str) -> None:
    fields = [line for line in message_definition(name).splitlines() if line and line[0] != "#" and "=" not in line]
    assert len(fields) > 5
    assert all("#" in line for line in fields)


@pytest.mark.parametrize("scale", [0.0, 0.5, 0.98, 1.02, 3.0, np.nan])
def test_an_orientation_that_is_no_rotation_is_refused(scale: float) -> None:
    from bridge.codec import TYPES

    raw = TYPES.deserialize_cdr(encode(ODOMETRY, EXAMPLES[4][1]), ODOMETRY.ros_type)
    turn = raw.pose.pose.orientation
    turn.z, turn.w = turn.z * scale, turn.w * scale
    with pytest.raises(InvalidMessage, match="odometry orientation has norm .*, limits 0.99..1.01"):
        decode(ODOMETRY, bytes(TYPES.serialize_cdr(raw, ODOMETRY.ros_type)))
