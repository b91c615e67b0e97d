"""The topic table: one line per stream on the wire.

Keys follow zenoh-bridge-ros2dds: the ROS 2 topic name without its leading slash.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from bridge.messages import FallHorizon, Keypoints, Message, NodeStatus, Odometry, SupportCommand, Wrench


class Topic(NamedTuple):
    """One stream: who may publish what, how often, and how old it may get."""

    key: str  # key expression below the configured namespace
    message: type[Message]  # what the nodes see
    ros_type: str  # what the wire sees, as CDR
    publisher: str  # the only role that may publish it; '*' for every role
    rate_hz: float  # nominal
    max_age_s: float  # older is a fault for every reader
    priority: str  # Zenoh priority
    express: bool  # send at once, do not batch


KEYPOINTS: Final = Topic(
    "keypoints", Keypoints, "surefoot_msgs/msg/Keypoints", "perception", 30, 0.150, "interactive_high", True
)
FALL_HORIZON: Final = Topic(
    "fall_horizon", FallHorizon, "surefoot_msgs/msg/FallHorizon", "anticipation", 30, 0.150, "interactive_high", True
)
WRENCH: Final = Topic("wrench", Wrench, "geometry_msgs/msg/WrenchStamped", "drive", 100, 0.060, "real_time", True)
ODOMETRY: Final = Topic("odom", Odometry, "nav_msgs/msg/Odometry", "drive", 100, 0.060, "real_time", True)
SUPPORT_COMMAND: Final = Topic(
    "support_command", SupportCommand, "surefoot_msgs/msg/SupportCommand", "controller", 100, 0.060, "real_time", True
)
TWIST: Final = Topic(
    "cmd_vel", SupportCommand, "geometry_msgs/msg/TwistStamped", "controller", 100, 0.060, "real_time", True
)
DIAGNOSTICS: Final = Topic(
    "diagnostics", NodeStatus, "diagnostic_msgs/msg/DiagnosticArray", "*", 5, 1.0, "data_low", False
)

TOPICS: Final = (KEYPOINTS, FALL_HORIZON, WRENCH, ODOMETRY, SUPPORT_COMMAND, TWIST, DIAGNOSTICS)
