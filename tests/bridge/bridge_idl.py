"""The contracts once more, for pycdr2: written from bridge/msg and the definitions of ROS 2 Jazzy.

No `from __future__ import annotations`: pycdr2 reads the annotations as they are.
"""

from dataclasses import dataclass

from pycdr2 import IdlStruct
from pycdr2.types import array, float64, int32, sequence, uint8, uint32, uint64


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class KeypointsIdl(IdlStruct, typename="surefoot_msgs::msg::dds_::Keypoints_"):
    header: Header
    sequence: uint64
    valid: bool
    reason: str
    image_width: uint32
    image_height: uint32
    position_px: array[float64, 24]
    confidence: array[float64, 12]
    status: array[uint8, 12]
    body_length_px: float64
    people: uint32


@dataclass
class FallHorizonIdl(IdlStruct, typename="surefoot_msgs::msg::dds_::FallHorizon_"):
    header: Header
    sequence: uint64
    valid: bool
    reason: str
    step_s: float64
    quality: float64
    probabilities: array[float64, 48]
    distance: array[float64, 16]
    distance_rate: array[float64, 16]
    time_to_boundary: array[float64, 16]
    centre_distance: array[float64, 48]
    plane: array[float64, 32]
    forecast_px: array[float64, 384]


@dataclass
class SupportCommandIdl(IdlStruct, typename="surefoot_msgs::msg::dds_::SupportCommand_"):
    header: Header
    sequence: uint64
    valid: bool
    reason: str
    rests_on: Time
    lifetime_s: float64
    state: str
    twist: Twist
    acceleration: array[float64, 4]
    column_height: float64
    stiffening: float64
    damping: array[float64, 4]
    stiffness: array[float64, 4]
    fall_distance: float64
    fall_probability: float64
    solver: str
    solve_time_s: float64


@dataclass
class Wrench(IdlStruct, typename="geometry_msgs::msg::dds_::Wrench_"):
    force: Vector3
    torque: Vector3


@dataclass
class WrenchStampedIdl(IdlStruct, typename="geometry_msgs::msg::dds_::WrenchStamped_"):
    header: Header
    wrench: Wrench


@dataclass
class TwistStampedIdl(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header
    twist: Twist


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class OdometryIdl(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArrayIdl(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]
