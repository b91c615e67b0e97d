"""What crosses a process, as frozen values. `bridge/msg` holds the same contracts as ROS 2 messages.

Arrays are float64 and read-only. `check()` raises `InvalidMessage` naming field,
value and limit when a message must not be acted on; it never repairs anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bridge.errors import InvalidMessage

Floats: TypeAlias = NDArray[np.float64]
Bytes: TypeAlias = NDArray[np.uint8]

KEYPOINTS = 12
STEPS = 16  # present + 15 steps of 1/30 s: half a second
CLASSES = ("stable", "transient", "fall")
STEP_S = 1.0 / 30.0


class KeypointStatus(IntEnum):
    """How a keypoint came to its position."""

    MEASURED = 0
    FILLED = 1
    LOST = 2


class GaitState(StrEnum):
    """States of the supervisor (design: DISARMED -> FOLLOW <-> GUARD -> ARREST -> RECOVER -> FOLLOW)."""

    DISARMED = "DISARMED"
    FOLLOW = "FOLLOW"
    GUARD = "GUARD"
    ARREST = "ARREST"
    RECOVER = "RECOVER"
    SAFE_STOP = "SAFE_STOP"


def frozen(array: object, shape: tuple[int, ...], name: str) -> Floats:
    """Return `array` as a read-only float64 array of `shape` that nobody else can write.

    What this function returned before is returned as it is: messages are copied with `replace` at every hop.

    Raises:
        InvalidMessage: the size does not fit.
    """
    if isinstance(array, np.ndarray) and array.shape == shape and array.dtype == np.float64:
        flags = array.flags
        if flags.owndata and not flags.writeable:
            return array
    value = np.array(array, dtype=np.float64)
    if value.size != math.prod(shape):
        raise InvalidMessage(f"{name} has shape {value.shape}, expected {shape}")
    if value.shape != shape:
        value = value.reshape(shape).copy()
    value.flags.writeable = False
    return value


def _require_finite(name: str, value: Floats | float) -> None:
    if not np.isfinite(value).all():
        raise InvalidMessage(f"{name} is not finite")


def _require_within(name: str, value: Floats | float, low: float, high: float) -> None:
    array = np.asarray(value)
    if not ((array >= low) & (array <= high)).all():
        bad = array[~((array >= low) & (array <= high))].flat[0]
        raise InvalidMessage(f"{name} is {bad:g}, limits {low:g}..{high:g}")


class Message(Protocol):
    """What every message has: a stamp, a sequence number and a check."""

    @property
    def stamp_ns(self) -> int:
        """Stamp of the newest measurement the message rests on [ns since the epoch]."""
        ...

    @property
    def sequence(self) -> int:
        """Counts up by one for each message of one publisher."""
        ...

    def check(self) -> None:
        """Raise `InvalidMessage` if the message must not be acted on."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Keypoints:
    """Twelve cleaned keypoints of one person (`Keypoints.msg`)."""

    stamp_ns: int
    position_px: Floats  # (12, 2), x right, y down [px]; NaN where LOST
    confidence: Floats  # (12,), 0..1
    status: Bytes  # (12,), KeypointStatus
    body_length_px: float  # [px]
    image_width: int  # [px]
    image_height: int  # [px]
    sequence: int = 0
    valid: bool = True
    reason: str = ""
    people: int = 1
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_px", frozen(self.position_px, (KEYPOINTS, 2), "position_px"))
        object.__setattr__(self, "confidence", frozen(self.confidence, (KEYPOINTS,), "confidence"))
        status = np.array(self.status, dtype=np.uint8)
        if status.shape != (KEYPOINTS,):
            raise InvalidMessage(f"status has shape {status.shape}, expected ({KEYPOINTS},)")
        status.flags.writeable = False
        object.__setattr__(self, "status", status)

    def check(self) -> None:
        """Raise `InvalidMessage` unless the keypoints may be used."""
        if not self.valid:
            raise InvalidMessage(f"keypoints are not valid: {self.reason or 'no reason given'}")
        _require_within("keypoint status", self.status.astype(np.float64), 0, 2)
        kept = self.status != KeypointStatus.LOST
        _require_finite("keypoint position", self.position_px[kept])
        reach = 10.0 * max(self.image_width, self.image_height, 1)
        _require_within("keypoint position [px]", self.position_px[kept], -reach, reach)
        _require_within("keypoint confidence", self.confidence, 0.0, 1.0)
        _require_finite("body_length_px", self.body_length_px)
        _require_within("body_length_px", self.body_length_px, 1e-3, reach)


@dataclass(frozen=True, slots=True, kw_only=True)
class FallHorizon:
    """The fall-state horizon, step 0 is the present (`FallHorizon.msg`)."""

    stamp_ns: int
    probabilities: Floats  # (16, 3) stable, transient, fall
    distance: Floats  # (16,) [within-class sd], positive outside
    distance_rate: Floats  # (16,) [1/s]
    time_to_boundary: Floats  # (16,) [s], inf when not closing
    centre_distance: Floats  # (16, 3) [within-class sd]
    plane: Floats  # (16, 2)
    forecast_px: Floats  # (16, 12, 2) [px]
    quality: float  # 0..1
    sequence: int = 0
    valid: bool = True
    reason: str = ""
    step_s: float = STEP_S
    frame_id: str = "camera"

    def __post_init__(self) -> None:
        for name, shape in _HORIZON_SHAPES.items():
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))

    def check(self) -> None:
        """Raise `InvalidMessage` unless the horizon may be used."""
        if not self.valid:
            raise InvalidMessage(f"horizon is not valid: {self.reason or 'no reason given'}")
        _require_finite("horizon probabilities", self.probabilities)
        _require_within("horizon probability", self.probabilities, -1e-6, 1.0 + 1e-6)
        _require_within("sum of horizon probabilities", self.probabilities.sum(axis=1), 0.999, 1.001)
        _require_finite("horizon distance", self.distance)
        _require_within("horizon distance [sd]", self.distance, -1e3, 1e3)
        _require_finite("horizon distance_rate", self.distance_rate)
        _require_within("horizon distance_rate [1/s]", self.distance_rate, -1e5, 1e5)
        _require_within("horizon time_to_boundary [s]", self.time_to_boundary, 0.0, np.inf)
        _require_within("horizon quality", self.quality, 0.0, 1.0)
        _require_within("horizon step_s", self.step_s, 1e-3, 1.0)


_HORIZON_SHAPES: dict[str, tuple[int, ...]] = {
    "probabilities": (STEPS, 3),
    "distance": (STEPS,),
    "distance_rate": (STEPS,),
    "time_to_boundary": (STEPS,),
    "centre_distance": (STEPS, 3),
    "plane": (STEPS, 2),
    "forecast_px": (STEPS, KEYPOINTS, 2),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench:
    """Interface wrench of the person on the walker, in the base frame (`geometry_msgs/WrenchStamped`)."""

    stamp_ns: int
    force: Floats  # (3,) x forward, y left, z up [N]; leaning on the walker is negative z
    torque: Floats  # (3,) [N m]
    sequence: int = 0
    frame_id: str = "interface"

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", frozen(self.force, (3,), "force"))
        object.__setattr__(self, "torque", frozen(self.torque, (3,), "torque"))

    def check(self) -> None:
        """Raise `InvalidMessage` unless the wrench is finite and physically possible."""
        _require_finite("wrench force", self.force)
        _require_finite("wrench torque", self.torque)
        _require_within("wrench force [N]", self.force, -5000.0, 5000.0)
        _require_within("wrench torque [N m]", self.torque, -2000.0, 2000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Odometry:
    """Pose and twist of the support frame (`nav_msgs/Odometry`).

    The support frame sits on the column's axis: x, y and yaw are those of the base,
    z is the column height. The pose is in the odometry frame, the velocities in the
    support frame, as `nav_msgs/Odometry` prescribes.
    """

    stamp_ns: int
    position: Floats  # (3,) x, y, column height [m]
    yaw: float  # [rad]
    velocity: Floats  # (3,) forward, left, column [m/s]
    yaw_rate: float  # [rad/s]
    sequence: int = 0
    frame_id: str = "odom"
    child_frame_id: str = "support"

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (3,), "position"))
        object.__setattr__(self, "velocity", frozen(self.velocity, (3,), "velocity"))

    def check(self) -> None:
        """Raise `InvalidMessage` unless pose and twist are finite and plausible."""
        _require_finite("odometry position", self.position)
        _require_finite("odometry yaw", self.yaw)
        _require_finite("odometry velocity", self.velocity)
        _require_finite("odometry yaw_rate", self.yaw_rate)
        _require_within("odometry velocity [m/s]", self.velocity, -10.0, 10.0)
        _require_within("odometry yaw_rate [rad/s]", self.yaw_rate, -20.0, 20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SupportCommand:
    """Base twist and column motion with the admittance that was rendered (`SupportCommand.msg`)."""

    stamp_ns: int
    velocity: Floats  # (4,) forward, left [m/s], yaw [rad/s], column [m/s]
    acceleration: Floats  # (4,) [m/s^2, m/s^2, rad/s^2, m/s^2]
    column_height: float  # [m]
    stiffening: float  # 0..1
    damping: Floats  # (4,) [N s/m, N s/m, N m s/rad, N s/m]
    stiffness: Floats  # (4,) [N/m, N/m, N m/rad, N/m]
    state: GaitState
    solver: str  # mpc, fallback or stop
    lifetime_s: float  # [s]
    sequence: int = 0
    valid: bool = True
    reason: str = ""
    rests_on_ns: int = 0
    fall_distance: float = float("nan")
    fall_probability: float = float("nan")
    solve_time_s: float = 0.0
    frame_id: str = "support"

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "damping", "stiffness"):
            object.__setattr__(self, name, frozen(getattr(self, name), (4,), name))
        object.__setattr__(self, "state", GaitState(self.state))

    def check(self) -> None:
        """Raise `InvalidMessage` unless the command may be executed by a drive."""
        _require_finite("command velocity", self.velocity)
        _require_finite("command acceleration", self.acceleration)
        _require_finite("command column_height", self.column_height)
        _require_finite("command damping or stiffness", self.damping)
        _require_finite("command damping or stiffness", self.stiffness)
        _require_within("command stiffening", self.stiffening, 0.0, 1.0)
        _require_within("command lifetime_s", self.lifetime_s, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeStatus:
    """How a process is doing (`diagnostic_msgs/DiagnosticArray` with one status)."""

    stamp_ns: int
    role: str
    level: int  # 0 ok, 1 warning, 2 error, 3 stale, as in diagnostic_msgs
    summary: str
    values: dict[str, str] = field(default_factory=dict)
    sequence: int = 0

    def check(self) -> None:
        """Raise `InvalidMessage` unless the level is one of diagnostic_msgs' levels."""
        _require_within("diagnostic level", float(self.level), 0, 3)
