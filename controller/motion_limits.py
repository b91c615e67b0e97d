"""Limits of motion: accelerations that keep velocity, acceleration, jerk, wheel speed and stroke in bounds for good.

A velocity limit cannot be kept by looking at velocity alone: with bounded jerk an acceleration takes a / j to fade.
So the limiter keeps the commanded motion *viable*: ramping the acceleration to zero at the largest jerk must end
inside the limits, that is `|v + a |a| / (2 j)| <= v_max`. If one step is viable the ramp makes the next one so,
whatever its length, and every command it lets through obeys all limits at once.
"""

from __future__ import annotations

import math

import numpy as np

from bridge.config.walker import WalkerConfig
from bridge.messages import Floats

_STROKE_RESERVE = 0.8  # part of acceleration and jerk that stopping before the stroke's end may count on
_STROKE_END_M = 0.002  # a stop in steps comes to rest this close to where a continuous one would
_BISECTIONS = 12


class MotionLimits:
    """Keeps commanded accelerations inside the walker's kinematic limits.

    Attributes:
        velocity, acceleration, jerk: (4,) limits along forward, left, yaw, height.
    """

    def __init__(self, config: WalkerConfig) -> None:
        self.velocity: Floats = np.array(config.velocity_max)
        self.acceleration: Floats = np.array(config.acceleration_max)
        self.jerk: Floats = np.array(config.jerk_max)
        self._low_m, self._high_m = config.column_low_m, config.column_high_m
        # Over the four wheels and both turning directions |J v| has every pattern of signs, so its maximum is
        # the weighted sum |v_x| + |v_y| + (l_x + l_y) |v_yaw| over the wheel radius.
        arm = 0.5 * (config.wheelbase_m + config.track_m)
        self._wheel_weights: Floats = np.array([1.0, 1.0, arm, 0.0])
        self._wheel_cap = config.wheel_radius_m * config.wheel_speed_max_rad_s

    def window(self, previous: Floats, span_s: float) -> tuple[Floats, Floats]:
        """Return the accelerations, lowest and highest (4,), within reach `span_s` after `previous`."""
        reach = self.jerk * span_s
        low: Floats = np.maximum(previous - reach, -self.acceleration)
        high: Floats = np.minimum(previous + reach, self.acceleration)
        return np.minimum(low, self.acceleration), np.maximum(high, -self.acceleration)

    def clamp(self, wanted: Floats, velocity: Floats, previous: Floats, height_m: float, span_s: float) -> Floats:
        """Return the acceleration nearest to `wanted` that keeps the commanded motion viable.

        Args:
            wanted: (4,) acceleration [m/s^2, rad/s^2].
            velocity: (4,) commanded velocity now [m/s, rad/s].
            previous: (4,) acceleration applied until now.
            height_m: commanded column height now [m].
            span_s: how long the acceleration will be applied [s].
        """
        low, high = self.window(previous, span_s)
        room = self.jerk * span_s
        rise = -room + np.sqrt(room**2 + 2.0 * self.jerk * np.maximum(self.velocity - velocity, 0.0))
        fall = room - np.sqrt(room**2 + 2.0 * self.jerk * np.maximum(self.velocity + velocity, 0.0))
        # The window comes last: what rate the machine has cannot be argued with.
        value: Floats = np.minimum(np.maximum(wanted, fall), rise)
        np.minimum(np.maximum(value, low, out=value), high, out=value)
        self._keep_wheels(value, velocity, low, high, span_s)
        value[3] = self._keep_stroke(
            float(value[3]), float(velocity[3]), float(low[3]), float(high[3]), height_m, span_s
        )
        return value

    def viable_velocity(self, velocity: Floats) -> Floats:
        """Return `velocity` (4,) scaled and clipped to what may be commanded at zero acceleration."""
        value: Floats = np.clip(velocity, -self.velocity, self.velocity)
        value[:3] *= min(1.0, self._wheel_cap / max(float(self._wheel_weights @ np.abs(value)), 1e-12))
        return value

    def _wheel_excess(self, acceleration: Floats, velocity: Floats, span_s: float) -> float:
        after = velocity + acceleration * span_s
        coasted = after + acceleration * np.abs(acceleration) / (2.0 * self.jerk)
        return float(self._wheel_weights @ np.maximum(np.abs(after), np.abs(coasted))) - self._wheel_cap

    def _keep_wheels(self, value: Floats, velocity: Floats, low: Floats, high: Floats, span_s: float) -> None:
        if self._wheel_excess(value, velocity, span_s) <= 0.0:
            return
        ramp = np.clip(0.0, low, high)
        step = value - ramp
        kept, out = 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (kept + out)
            if self._wheel_excess(ramp + middle * step, velocity, span_s) <= 0.0:
                kept = middle
            else:
                out = middle
        value[:3] = ramp[:3] + kept * step[:3]

    def _keep_stroke(
        self, value: float, velocity: float, low: float, high: float, height_m: float, span_s: float
    ) -> float:
        for sign, end in ((1.0, self._high_m), (-1.0, -self._low_m)):
            room = end - sign * height_m - _STROKE_END_M
            if sign * velocity + abs(value) * span_s <= 0.0 or self._stops(sign * value, sign * velocity, room, span_s):
                continue
            brake = low if sign > 0 else high
            if not self._stops(sign * brake, sign * velocity, room, span_s):
                return brake
            kept, out = brake, value
            for _ in range(_BISECTIONS):
                middle = 0.5 * (kept + out)
                if self._stops(sign * middle, sign * velocity, room, span_s):
                    kept = middle
                else:
                    out = middle
            value = kept
        return value

    def _stops(self, acceleration: float, velocity: float, room_m: float, span_s: float) -> bool:
        """Whether a column moving towards an end `room_m` away can still stop before it."""
        jerk = _STROKE_RESERVE * float(self.jerk[3])
        braking = _STROKE_RESERVE * float(self.acceleration[3])
        way = velocity * span_s + 0.5 * acceleration * span_s**2
        speed = velocity + acceleration * span_s
        if acceleration > 0.0:
            way += speed * acceleration / jerk + acceleration**3 / (3.0 * jerk**2)
            speed += acceleration**2 / (2.0 * jerk)
        if speed <= 0.0:
            return way <= room_m
        if speed > braking**2 / jerk:
            way += 0.5 * speed * (speed / braking + braking / jerk)
        else:
            way += speed * math.sqrt(speed / jerk)
        return way <= room_m


def acceleration_to_rest(velocity: Floats, limits: MotionLimits, span_s: float) -> Floats:
    """Return the (4,) acceleration that brings `velocity` to rest soonest when followed at every step.

    Solves `v + a dt + a |a| / (2 j) = 0`: what is left after this step is just what fading `a` away takes.
    """
    jerk = limits.jerk
    value: Floats = -np.sign(velocity) * jerk * (np.sqrt(span_s**2 + 2.0 * np.abs(velocity) / jerk) - span_s)
    return np.clip(value, -limits.acceleration, limits.acceleration)
