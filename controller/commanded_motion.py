"""The motion the walker has been told to make, held to the motion it makes.

An admittance controller that started each step from the measured velocity would add the drive's lag to the rendered
mass: with a lag tau the command never leads the measurement by more than one period's acceleration, so the
base answers tau / T times too slowly. The command is therefore integrated from the command before; the drive's lag then
only delays it. What keeps it from running away when the base cannot follow (a wall, a clipped command)
is a virtual coupling (Colgate, Stanley and Brown 1995): beyond a tolerance, the difference to the measured velocity
acts on the rendered mass as a force, so it goes through the law and its limits like any other. The pose is drawn to
the measured one slowly, which takes out drift and leaves the spring undisturbed by lag.
"""

from __future__ import annotations

import math

import numpy as np

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats, Odometry
from controller.motion_limits import MotionLimits

YAW = 2


class CommandedMotion:
    """Pose, velocity and acceleration that the commands so far amount to.

    Attributes:
        pose: (4,) x, y, yaw, height in the odometry frame [m, rad].
        velocity: (4,) forward, left, yaw, column in the base frame [m/s, rad/s].
        acceleration: (4,) applied over the last period.
    """

    def __init__(self, config: MpcConfig, limits: MotionLimits, stroke_m: tuple[float, float]) -> None:
        self._tolerance = config.tracking_tolerance_m_s
        self._rate = config.tracking_rate_per_s
        self._pose_rate = config.pose_rate_per_s
        self._limits = limits
        self._stroke_m = stroke_m
        self.rest()

    def rest(self) -> None:
        """Forget the past: at rest, nobody knows where."""
        self.pose: Floats = np.array([0.0, 0.0, 0.0, 0.5 * (self._stroke_m[0] + self._stroke_m[1])])
        self.velocity: Floats = np.zeros(4)
        self.acceleration: Floats = np.zeros(4)

    def start(self, odometry: Odometry) -> None:
        """Take over the measured motion, as far as it is one that may be commanded."""
        self.pose = measured_pose(odometry)
        self.pose[3] = min(max(self.pose[3], self._stroke_m[0]), self._stroke_m[1])
        self.velocity = self._limits.viable_velocity(measured_velocity(odometry))
        self.acceleration = np.zeros(4)

    def coupling(self, odometry: Odometry, mass: Floats) -> Floats:
        """Return the (4,) force that draws the commanded velocity to the measured one beyond the tolerance."""
        apart = measured_velocity(odometry) - self.velocity
        if max(map(abs, apart.tolist())) <= self._tolerance:
            return np.zeros(4)
        excess = np.sign(apart) * np.maximum(np.abs(apart) - self._tolerance, 0.0)
        result: Floats = self._rate * mass * excess
        return result

    def follow(self, odometry: Odometry, span_s: float, hold_height: bool) -> None:
        """Draw the commanded pose to the measured one; not the height of a column that is to hold, however it sags."""
        share = min(self._pose_rate * span_s, 1.0)
        x, y, yaw, height = self.pose.tolist()
        measured_x, measured_y, measured_height = odometry.position.tolist()
        turned = math.remainder(odometry.yaw - yaw, 2.0 * math.pi)
        if not hold_height:
            height += share * (measured_height - height)
        self.pose[:] = (
            x + share * (measured_x - x),
            y + share * (measured_y - y),
            yaw + share * turned,
            min(max(height, self._stroke_m[0]), self._stroke_m[1]),
        )

    def advance(self, acceleration: Floats, span_s: float) -> None:
        """Apply an acceleration (4,) for `span_s`."""
        before = self.velocity
        self.velocity = before + acceleration * span_s
        forward, left, turn, column = (0.5 * span_s * (before + self.velocity)).tolist()
        x, y, yaw, height = self.pose.tolist()
        heading = yaw + 0.5 * turn
        cosine, sine = math.cos(heading), math.sin(heading)
        self.pose[:] = (
            x + cosine * forward - sine * left,
            y + sine * forward + cosine * left,
            yaw + turn,
            min(max(height + column, self._stroke_m[0]), self._stroke_m[1]),
        )
        self.acceleration = acceleration


def measured_pose(odometry: Odometry) -> Floats:
    """Return x, y, yaw, height (4,) [m, rad]."""
    position = odometry.position
    return np.array([position[0], position[1], odometry.yaw, position[2]])


def measured_velocity(odometry: Odometry) -> Floats:
    """Return forward, left, yaw, column (4,) [m/s, rad/s]."""
    velocity = odometry.velocity
    return np.array([velocity[0], velocity[1], odometry.yaw_rate, velocity[2]])
