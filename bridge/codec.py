"""Messages to CDR and back: written by `bridge.cdr`, read through the type store of `rosbags`.

The wire carries ROS 2 CDR only; whatever does not decode to a whole, well-formed
message is an `InvalidMessage`, never a partial value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from importlib.resources import files
from typing import Any, Final

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bridge.cdr import WRITERS
from bridge.clock import NS
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
from bridge.topics import Topic

OWN_TYPES: Final = ("Keypoints", "FallHorizon", "SupportCommand")
MAX_PAYLOAD_BYTES: Final = 65_536  # the largest message here is under 8 kB


def message_definition(name: str) -> str:
    """Return the text of `bridge/msg/<name>.msg`."""
    return (files("bridge") / "msg" / f"{name}.msg").read_text(encoding="utf-8")


def _make_store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in OWN_TYPES:
        store.register(get_types_from_msg(message_definition(name), f"surefoot_msgs/msg/{name}"))
    return store


TYPES: Final = _make_store()


def prepare(topic: Topic) -> None:
    """Have the codec of `topic` ready: rosbags writes and compiles it at first use, which takes tens of ms."""
    TYPES.get_msgdef(topic.ros_type)


def encode(topic: Topic, message: Message, sequence: int | None = None) -> bytes:
    """Return `message` as the CDR bytes that `topic` carries, under its own number or under `sequence`."""
    number = message.sequence if sequence is None else sequence
    return WRITERS[topic.ros_type](message, number)


def decode(topic: Topic, payload: bytes, sequence: int = 0) -> Any:
    """Return the message in `payload`; its values are not judged yet (see `Message.check`).

    Args:
        topic: stream the bytes came from.
        payload: CDR bytes.
        sequence: number the transport attached, for standard types that carry none.

    Raises:
        InvalidMessage: the bytes are not one whole message of the topic's type.
    """
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise InvalidMessage(f"{topic.key} is {len(payload)} bytes, limit {MAX_PAYLOAD_BYTES}")
    try:
        raw = TYPES.deserialize_cdr(payload, topic.ros_type)
        if topic.ros_type.startswith("surefoot_msgs/"):
            _require_flag(payload)
        return _DECODERS[topic.ros_type](raw, sequence)
    except InvalidMessage:
        raise
    except (SerdeError, ValueError, TypeError, KeyError, IndexError, OverflowError, MemoryError, struct.error) as error:
        raise InvalidMessage(f"{topic.key} does not decode as {topic.ros_type}: {error}") from error


def _require_flag(payload: bytes) -> None:
    """Refuse a `valid` that is neither 0 nor 1, the two octets CDR knows; the reader would take any other for true.

    It follows the header (stamp, frame_id) and the sequence number, which is aligned to eight.
    """
    text_end = 12 + int.from_bytes(payload[12:16], "little" if payload[1] else "big")  # behind the encapsulation
    flag = payload[4 + (text_end + 7) // 8 * 8 + 8]
    if flag > 1:
        raise InvalidMessage(f"valid is {flag}, limits 0..1")


def _ns(stamp: Any) -> int:
    if stamp.nanosec >= NS:
        raise InvalidMessage(f"stamp has {stamp.nanosec} ns beside its seconds, limit {NS - 1}")
    return int(stamp.sec) * NS + int(stamp.nanosec)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _decode_keypoints(raw: Any, _sequence: int) -> Keypoints:
    return Keypoints(
        stamp_ns=_ns(raw.header.stamp),
        frame_id=raw.header.frame_id,
        sequence=int(raw.sequence),
        valid=bool(raw.valid),
        reason=raw.reason,
        image_width=int(raw.image_width),
        image_height=int(raw.image_height),
        position_px=raw.position_px,
        confidence=raw.confidence,
        status=raw.status,
        body_length_px=float(raw.body_length_px),
        people=int(raw.people),
    )


def _decode_horizon(raw: Any, _sequence: int) -> FallHorizon:
    return FallHorizon(
        stamp_ns=_ns(raw.header.stamp),
        frame_id=raw.header.frame_id,
        sequence=int(raw.sequence),
        valid=bool(raw.valid),
        reason=raw.reason,
        step_s=float(raw.step_s),
        quality=float(raw.quality),
        probabilities=raw.probabilities,
        distance=raw.distance,
        distance_rate=raw.distance_rate,
        time_to_boundary=raw.time_to_boundary,
        centre_distance=raw.centre_distance,
        plane=raw.plane,
        forecast_px=raw.forecast_px,
    )


def _decode_command(raw: Any, _sequence: int) -> SupportCommand:
    linear, angular = raw.twist.linear, raw.twist.angular
    return SupportCommand(
        stamp_ns=_ns(raw.header.stamp),
        frame_id=raw.header.frame_id,
        sequence=int(raw.sequence),
        valid=bool(raw.valid),
        reason=raw.reason,
        rests_on_ns=_ns(raw.rests_on),
        lifetime_s=float(raw.lifetime_s),
        state=GaitState(raw.state),
        velocity=np.array((linear.x, linear.y, angular.z, linear.z)),
        acceleration=raw.acceleration,
        column_height=float(raw.column_height),
        stiffening=float(raw.stiffening),
        damping=raw.damping,
        stiffness=raw.stiffness,
        fall_distance=float(raw.fall_distance),
        fall_probability=float(raw.fall_probability),
        solver=raw.solver,
        solve_time_s=float(raw.solve_time_s),
    )


def _refuse_twist_stamped(_raw: Any, _sequence: int) -> Any:
    raise InvalidMessage("cmd_vel is written for foreign bases only; read support_command")


def _decode_wrench(raw: Any, sequence: int) -> Wrench:
    return Wrench(
        stamp_ns=_ns(raw.header.stamp),
        frame_id=raw.header.frame_id,
        force=np.array(_xyz(raw.wrench.force)),
        torque=np.array(_xyz(raw.wrench.torque)),
        sequence=sequence,
    )


def _decode_odometry(raw: Any, sequence: int) -> Odometry:
    turn = raw.pose.pose.orientation
    norm = math.sqrt(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2)
    if not 0.99 <= norm <= 1.01:
        raise InvalidMessage(f"odometry orientation has norm {norm:g}, limits 0.99..1.01")
    yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2))
    return Odometry(
        stamp_ns=_ns(raw.header.stamp),
        frame_id=raw.header.frame_id,
        child_frame_id=raw.child_frame_id,
        position=np.array(_xyz(raw.pose.pose.position)),
        yaw=yaw,
        velocity=np.array(_xyz(raw.twist.twist.linear)),
        yaw_rate=float(raw.twist.twist.angular.z),
        sequence=sequence,
    )


def _decode_status(raw: Any, sequence: int) -> NodeStatus:
    if len(raw.status) != 1:
        raise InvalidMessage(f"diagnostics has {len(raw.status)} statuses, expected 1")
    status = raw.status[0]
    return NodeStatus(
        stamp_ns=_ns(raw.header.stamp),
        role=status.hardware_id,
        level=int(status.level),
        summary=status.message,
        values={pair.key: pair.value for pair in status.values},
        sequence=sequence,
    )


_DECODERS: Final[dict[str, Callable[[Any, int], Any]]] = {
    "surefoot_msgs/msg/Keypoints": _decode_keypoints,
    "surefoot_msgs/msg/FallHorizon": _decode_horizon,
    "surefoot_msgs/msg/SupportCommand": _decode_command,
    "geometry_msgs/msg/TwistStamped": _refuse_twist_stamped,
    "geometry_msgs/msg/WrenchStamped": _decode_wrench,
    "nav_msgs/msg/Odometry": _decode_odometry,
    "diagnostic_msgs/msg/DiagnosticArray": _decode_status,
}
