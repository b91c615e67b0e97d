"""The topic table: one line per stream on the wire.

Keys follow zenoh-bridge-ros2dds: the ROS 2 topic name without its leading slash.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

from bridge.messages import FallHorizon, Keypoints, Message, NodeStatus, Odometry, SupportCommand, Wrench


class Quality(NamedTuple):
    """How Zenoh carries a stream. No writer is ever held up: a sample is dropped rather than waited for."""

    priority: str  # Zenoh priority
    express: bool  # send at once, do not batch
    delivery: Literal["every", "newest"]  # what a reader that keeps up is promised: every sample, or the newest


SEEN: Final = Quality("interactive_high", True, "every")
CONTROL: Final = Quality("real_time", True, "newest")  # at a rate at which one lost sample is made up for by the next
SAID: Final = Quality("data_low", False, "every")


class Topic(NamedTuple):
    """One stream: who may publish what, how often, and how old it may get."""

    key: str  # key expression below the configured namespace
    message: type[Message]  # what the nodes see
    ros_type: str  # what the wire sees, as CDR
    publisher: str  # the only role that may publish it; '*' for every role
    rate_hz: float  # nominal
    max_age_s: float  # older is a fault for every reader
    quality: Quality

    @property
    def priority(self) -> str:
        """Zenoh priority."""
        return self.quality.priority

    @property
    def express(self) -> bool:
        """Whether samples are sent at once and not batched."""
        return self.quality.express


DETECTIONS: Final = Topic("detections", Keypoints, "surefoot_msgs/msg/Keypoints", "drive", 30, 0.150, SEEN)
KEYPOINTS: Final = Topic("keypoints", Keypoints, "surefoot_msgs/msg/Keypoints", "perception", 30, 0.150, SEEN)
FALL_HORIZON: Final = Topic(
    "fall_horizon", FallHorizon, "surefoot_msgs/msg/FallHorizon", "anticipation", 30, 0.150, SEEN
)
WRENCH: Final = Topic("wrench", Wrench, "geometry_msgs/msg/WrenchStamped", "drive", 100, 0.060, CONTROL)
ODOMETRY: Final = Topic("odom", Odometry, "nav_msgs/msg/Odometry", "drive", 100, 0.060, CONTROL)
SUPPORT_COMMAND: Final = Topic(
    "support_command", SupportCommand, "surefoot_msgs/msg/SupportCommand", "controller", 100, 0.060, CONTROL
)
TWIST: Final = Topic("cmd_vel", SupportCommand, "geometry_msgs/msg/TwistStamped", "controller", 100, 0.060, CONTROL)
DIAGNOSTICS: Final = Topic("diagnostics", NodeStatus, "diagnostic_msgs/msg/DiagnosticArray", "*", 5, 1.0, SAID)

TOPICS: Final = (KEYPOINTS, FALL_HORIZON, WRENCH, ODOMETRY, SUPPORT_COMMAND, TWIST, DETECTIONS, DIAGNOSTICS)
