"""What a valid message is, said a second time and independently of `bridge`: its layout in CDR and its values.

Layouts are written down from the ROS 2 definitions, the walk over the bytes from the rules of CDR (OMG formal/02-06-51,
15.3: primitive types aligned to their size, counted from the end of the four-byte encapsulation; strings as
a length that includes the terminating NUL). Ranges are those that docs/wire.md promises. No code of `bridge` is used.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

Values = dict[str, Any]

_SIZES: Final = {"d": 8, "Q": 8, "i": 4, "I": 4, "B": 1, "?": 1}
_HEADER: Final = ("sec:i", "nanosec:I", "frame_id:s")

# name:type or name:type*count; s is a string
LAYOUTS: Final[Mapping[str, Sequence[str]]] = {
    "surefoot_msgs/msg/Keypoints": (
        *_HEADER, "sequence:Q", "valid:?", "reason:s", "image_width:I", "image_height:I", "position:d*24",
        "confidence:d*12", "status:B*12", "body_length:d", "people:I",
    ),
    "surefoot_msgs/msg/FallHorizon": (
        *_HEADER, "sequence:Q", "valid:?", "reason:s", "step:d", "quality:d", "probabilities:d*48", "distance:d*16",
        "rate:d*16", "time:d*16", "centre:d*48", "plane:d*32", "forecast:d*384",
    ),
    "surefoot_msgs/msg/SupportCommand": (
        *_HEADER, "sequence:Q", "valid:?", "reason:s", "rests_sec:i", "rests_nanosec:I", "lifetime:d", "state:s",
        "linear:d*3", "angular:d*3", "acceleration:d*4", "height:d", "stiffening:d", "damping:d*4", "stiffness:d*4",
        "fall_distance:d", "fall_probability:d", "solver:s", "solve_time:d",
    ),
    "geometry_msgs/msg/WrenchStamped": (*_HEADER, "force:d*3", "torque:d*3"),
    "nav_msgs/msg/Odometry": (
        *_HEADER, "child_frame_id:s", "position:d*3", "orientation:d*4", "pose_covariance:d*36", "linear:d*3",
        "angular:d*3", "twist_covariance:d*36",
    ),
}  # fmt: skip


class Malformed(Exception):  # noqa: N818 (it describes the bytes)
    """The bytes are not one whole message of the layout."""


class _Walk:
    """Reads CDR from front to back."""

    def __init__(self, payload: bytes) -> None:
        if len(payload) < 4 or payload[0] != 0 or payload[1] not in (0, 1):
            raise Malformed("encapsulation")
        self._order = "<" if payload[1] else ">"
        self._data = payload[4:]
        self._at = 0

    def numbers(self, kind: str, count: int) -> tuple[Any, ...]:
        size = _SIZES[kind]
        self._at += -self._at % size
        end = self._at + size * count
        if end > len(self._data):
            raise Malformed("cut off")
        values = struct.unpack_from(f"{self._order}{count}{'B' if kind == '?' else kind}", self._data, self._at)
        self._at = end
        if kind == "?" and values[0] > 1:
            raise Malformed("a bool that is neither")
        return values

    def text(self) -> str:
        length = self.numbers("I", 1)[0]
        raw = self._data[self._at : self._at + length]
        if len(raw) < length:
            raise Malformed("cut off")
        self._at += length
        if length == 0:
            return ""  # some writers leave the NUL of an empty string away
        if raw[-1] != 0:
            raise Malformed("string without an end")
        try:
            return raw[:-1].decode()
        except UnicodeDecodeError as error:
            raise Malformed("string that is no text") from error

    def finish(self) -> None:
        """Nothing but padding to a multiple of four may follow."""
        if len(self._data) - self._at > 3:
            raise Malformed("longer than the message")


def parse(ros_type: str, payload: bytes) -> Values:
    """Return the fields of `payload` by name.

    Raises:
        Malformed: it is not one whole message of `ros_type`.
    """
    walk = _Walk(payload)
    if ros_type == "diagnostic_msgs/msg/DiagnosticArray":
        return _parse_diagnostics(walk)
    values: Values = {}
    for item in LAYOUTS[ros_type]:
        name, _, kind = item.partition(":")
        if kind == "s":
            values[name] = walk.text()
            continue
        letter, _, count = kind.partition("*")
        numbers = walk.numbers(letter, int(count or 1))
        values[name] = numbers if count else numbers[0]
    walk.finish()
    return values


def _parse_diagnostics(walk: _Walk) -> Values:
    sec, nanosec = walk.numbers("i", 1)[0], walk.numbers("I", 1)[0]
    frame_id = walk.text()
    if walk.numbers("I", 1)[0] != 1:
        raise Malformed("not one status")
    level = walk.numbers("B", 1)[0]
    texts = [walk.text() for _ in range(3)]
    pairs = [(walk.text(), walk.text()) for _ in range(walk.numbers("I", 1)[0])]
    walk.finish()
    return {"sec": sec, "nanosec": nanosec, "frame_id": frame_id, "level": level, "texts": texts, "pairs": pairs}


def wrong(ros_type: str, values: Values) -> str:
    """Return why the message must not be acted on, '' if it may."""
    if values["nanosec"] >= 1_000_000_000:
        return "nanosec"
    if values.get("valid") == 0 and ros_type != "surefoot_msgs/msg/SupportCommand":
        return "declared invalid"
    return _RULES[ros_type](values)


def _finite(values: Values, *names: str) -> str:
    for name in names:
        value = values[name]
        if not all(math.isfinite(v) for v in (value if isinstance(value, tuple) else (value,))):
            return f"{name} is not finite"
    return ""


def _within(values: Values, name: str, low: float, high: float) -> str:
    value = values[name]
    good = all(low <= v <= high for v in (value if isinstance(value, tuple) else (value,)))
    return "" if good else f"{name} beyond {low:g}..{high:g}"


def _first(*reasons: str) -> str:
    return next(filter(None, reasons), "")


def _keypoints(v: Values) -> str:
    reach = 10.0 * max(v["image_width"], v["image_height"], 1)
    kept = [k for k in range(12) if v["status"][k] != 2]
    positions = [v["position"][2 * k + i] for k in kept for i in (0, 1)]
    return _first(
        "" if all(s <= 2 for s in v["status"]) else "status",
        "" if all(math.isfinite(p) and abs(p) <= reach for p in positions) else "position",
        _within(v, "confidence", 0.0, 1.0),
        _within(v, "body_length", 1e-3, reach),
    )


def _horizon(v: Values) -> str:
    rows = [math.fsum(v["probabilities"][3 * k : 3 * k + 3]) for k in range(16)]
    return _first(
        _within(v, "probabilities", -2e-6, 1.0 + 2e-6),
        "" if all(0.9989 <= row <= 1.0011 for row in rows) else "sum of probabilities",
        _within(v, "distance", -1e3, 1e3),
        _within(v, "rate", -1e5, 1e5),
        _within(v, "time", 0.0, math.inf),
        _within(v, "quality", 0.0, 1.0),
        _within(v, "step", 1e-3, 1.0),
    )


def _command(v: Values) -> str:
    states = ("DISARMED", "FOLLOW", "GUARD", "ARREST", "RECOVER", "SAFE_STOP")
    return _first(
        "" if v["rests_nanosec"] < 1_000_000_000 else "rests_on",
        "" if v["state"] in states else "state",
        _finite(v, "linear", "acceleration", "height", "damping", "stiffness"),
        "" if math.isfinite(v["angular"][2]) else "yaw rate is not finite",
        _within(v, "stiffening", 0.0, 1.0),
        _within(v, "lifetime", 0.0, 1.0),
    )


def _wrench(v: Values) -> str:
    return _first(_within(v, "force", -5000.0, 5000.0), _within(v, "torque", -2000.0, 2000.0))


def _odometry(v: Values) -> str:
    norm = math.sqrt(math.fsum(q * q for q in v["orientation"])) if not _finite(v, "orientation") else math.nan
    return _first(
        "" if 0.9899 <= norm <= 1.0101 else "orientation",
        _finite(v, "position"),
        _within(v, "linear", -10.0, 10.0),
        "" if abs(v["angular"][2]) <= 20.0 else "yaw rate",
    )


def _diagnostics(v: Values) -> str:
    return "" if v["level"] <= 3 else "level"


_RULES: Final[Mapping[str, Callable[[Values], str]]] = {
    "surefoot_msgs/msg/Keypoints": _keypoints,
    "surefoot_msgs/msg/FallHorizon": _horizon,
    "surefoot_msgs/msg/SupportCommand": _command,
    "geometry_msgs/msg/WrenchStamped": _wrench,
    "nav_msgs/msg/Odometry": _odometry,
    "diagnostic_msgs/msg/DiagnosticArray": _diagnostics,
}
