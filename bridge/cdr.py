"""Messages to CDR, little-endian, written straight into one buffer.

The type store of `rosbags` would do it by way of an object for every nested message, which costs several times as
much in a loop that has just been asleep. The bytes are the same: a test compares them. Rules: OMG
formal/02-06-51, 15.3: numbers aligned to their size, counted from the end of the encapsulation; strings as their length
with the terminating NUL, four bytes, then the text.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from struct import Struct
from typing import Any, Final

from bridge.clock import NS
from bridge.messages import FallHorizon, Floats, Keypoints, NodeStatus, Odometry, SupportCommand, Wrench

_ENCAPSULATION: Final = b"\x00\x01\x00\x00"
_TIME: Final = Struct("<iI")
_LENGTH: Final = Struct("<I")
_SEQUENCE_VALID: Final = Struct("<Q?")
_TWO_INTEGERS: Final = Struct("<II")
_ONE, _TWO, _THREE, _FOUR, _SIX = (Struct(f"<{n}d") for n in (1, 2, 3, 4, 6))
_NO_COVARIANCE: Final = bytes(36 * 8)


class _Writer:
    """A payload that grows; `data` begins behind the encapsulation, from where alignment counts."""

    __slots__ = ("data",)

    def __init__(self, stamp_ns: int, frame_id: str) -> None:
        """Begin with a `std_msgs/Header`."""
        self.data = bytearray(_TIME.pack(stamp_ns // NS, stamp_ns % NS))
        self.text(frame_id)

    def text(self, text: str) -> None:
        """Append a string."""
        raw, data = text.encode(), self.data
        data += bytes(-len(data) % 4)
        data += _LENGTH.pack(len(raw) + 1)
        data += raw
        data.append(0)

    def align(self, size: int) -> None:
        """Pad to a multiple of `size`."""
        self.data += bytes(-len(self.data) % size)

    def numbered(self, sequence: int, valid: bool, reason: str) -> None:
        """Append what every message of ours has next."""
        self.align(8)
        self.data += _SEQUENCE_VALID.pack(sequence, valid)
        self.text(reason)

    def payload(self) -> bytes:
        """Return the whole."""
        return _ENCAPSULATION + self.data


def _keypoints(m: Keypoints, sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.numbered(sequence, m.valid, m.reason)
    w.align(4)
    w.data += _TWO_INTEGERS.pack(m.image_width, m.image_height)
    w.align(8)
    w.data += m.position_px.tobytes()
    w.data += m.confidence.tobytes()
    w.data += m.status.tobytes()
    w.align(8)
    w.data += _ONE.pack(m.body_length_px)
    w.data += _LENGTH.pack(m.people)
    return w.payload()


def _horizon(m: FallHorizon, sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.numbered(sequence, m.valid, m.reason)
    w.align(8)
    w.data += _TWO.pack(m.step_s, m.quality)
    for array in (m.probabilities, m.distance, m.distance_rate, m.time_to_boundary):
        w.data += array.tobytes()
    for array in (m.centre_distance, m.plane, m.forecast_px):
        w.data += array.tobytes()
    return w.payload()


def _command(m: SupportCommand, sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.numbered(sequence, m.valid, m.reason)
    w.align(4)
    w.data += _TIME.pack(m.rests_on_ns // NS, m.rests_on_ns % NS)
    w.align(8)
    w.data += _ONE.pack(m.lifetime_s)
    w.text(m.state.value)
    w.align(8)
    w.data += _twist(m.velocity)
    w.data += m.acceleration.tobytes()
    w.data += _TWO.pack(m.column_height, m.stiffening)
    w.data += m.damping.tobytes()
    w.data += m.stiffness.tobytes()
    w.data += _TWO.pack(m.fall_distance, m.fall_probability)
    w.text(m.solver)
    w.align(8)
    w.data += _ONE.pack(m.solve_time_s)
    return w.payload()


def _twist_stamped(m: SupportCommand, _sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.align(8)
    w.data += _twist(m.velocity)
    return w.payload()


def _twist(velocity: Floats) -> bytes:
    vx, vy, yaw_rate, column = velocity.tolist()
    return _SIX.pack(vx, vy, column, 0.0, 0.0, yaw_rate)


def _wrench(m: Wrench, _sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.align(8)
    w.data += m.force.tobytes()
    w.data += m.torque.tobytes()
    return w.payload()


def _odometry(m: Odometry, _sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, m.frame_id)
    w.text(m.child_frame_id)
    w.align(8)
    w.data += m.position.tobytes()
    w.data += _FOUR.pack(0.0, 0.0, math.sin(m.yaw / 2.0), math.cos(m.yaw / 2.0))
    w.data += _NO_COVARIANCE
    w.data += m.velocity.tobytes()
    w.data += _THREE.pack(0.0, 0.0, m.yaw_rate)
    w.data += _NO_COVARIANCE
    return w.payload()


def _status(m: NodeStatus, _sequence: int) -> bytes:
    w = _Writer(m.stamp_ns, "")
    w.align(4)
    w.data += _LENGTH.pack(1)
    w.data.append(m.level)
    for text in (f"surefoot: {m.role}", m.summary, m.role):
        w.text(text)
    w.align(4)
    w.data += _LENGTH.pack(len(m.values))
    for key, value in m.values.items():
        w.text(key)
        w.text(value)
    return w.payload()


WRITERS: Final[dict[str, Callable[[Any, int], bytes]]] = {
    "surefoot_msgs/msg/Keypoints": _keypoints,
    "surefoot_msgs/msg/FallHorizon": _horizon,
    "surefoot_msgs/msg/SupportCommand": _command,
    "geometry_msgs/msg/TwistStamped": _twist_stamped,
    "geometry_msgs/msg/WrenchStamped": _wrench,
    "nav_msgs/msg/Odometry": _odometry,
    "diagnostic_msgs/msg/DiagnosticArray": _status,
}
