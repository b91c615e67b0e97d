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
        self._axes = tuple(zip(config.velocity_max, config.acceleration_max, config.jerk_max, strict=True))
        self._low_m, self._high_m = config.column_low_m, config.column_high_m
        # Over the four wheels and both turning directions |J v| has every pattern of signs, so its maximum is
        # the weighted sum |v_x| + |v_y| + (l_x + l_y) |v_yaw| over the wheel radius.
        arm = 0.5 * (config.wheelbase_m + config.track_m)
        self._weights = (1.0, 1.0, arm, 0.0)
        self._wheel_cap = config.wheel_radius_m * config.wheel_speed_max_rad_s

    def clamp(self, wanted: Floats, velocity: Floats, previous: Floats, height_m: float, span_s: float) -> Floats:
        """Return the acceleration nearest to `wanted` that keeps the commanded motion viable.

        Args:
            wanted: (4,) acceleration [m/s^2, rad/s^2].
            velocity: (4,) commanded velocity now [m/s, rad/s].
            previous: (4,) acceleration applied until now.
            height_m: commanded column height now [m].
            span_s: how long the acceleration will be applied [s].
        """
        # Four axes are fewer than an array operation is worth: plain numbers take a fifth of the time.
        speed = velocity.tolist()
        value, low, high = [], [], []
        for want, now, before, (fastest, most, jerk) in zip(
            wanted.tolist(), speed, previous.tolist(), self._axes, strict=True
        ):
            room = jerk * span_s
            least_reached, most_reached = min(max(before - room, -most), most), max(min(before + room, most), -most)
            rise = math.sqrt(room**2 + 2.0 * jerk * max(fastest - now, 0.0)) - room
            fall = room - math.sqrt(room**2 + 2.0 * jerk * max(fastest + now, 0.0))
            # The reach comes last: what rate the machine has cannot be argued with.
            value.append(min(max(min(max(want, fall), rise), least_reached), most_reached))
            low.append(least_reached)
            high.append(most_reached)
        value = self._keep_wheels(value, speed, low, high, span_s)
        value[3] = self._keep_stroke(value[3], speed[3], low[3], high[3], height_m, span_s)
        return np.array(value)

    def viable_velocity(self, velocity: Floats) -> Floats:
        """Return `velocity` (4,) scaled and clipped to what may be commanded at zero acceleration."""
        value: Floats = np.clip(velocity, -self.velocity, self.velocity)
        value[:3] *= min(1.0, self._wheel_cap / max(float(np.dot(self._weights, np.abs(value))), 1e-12))
        return value

    def _wheel_excess(self, acceleration: list[float], velocity: list[float], span_s: float) -> float:
        total = -self._wheel_cap
        for value, now, (_, _, jerk), weight in zip(acceleration, velocity, self._axes, self._weights, strict=True):
            after = now + value * span_s
            total += weight * max(abs(after), abs(after + value * abs(value) / (2.0 * jerk)))
        return total

    def _keep_wheels(
        self, value: list[float], velocity: list[float], low: list[float], high: list[float], span_s: float
    ) -> list[float]:
        if self._wheel_excess(value, velocity, span_s) <= 0.0:
            return value
        ramp = [min(max(0.0, least), most) for least, most in zip(low, high, strict=True)]

        def along(share: float) -> list[float]:
            return [start + share * (end - start) for start, end in zip(ramp, value, strict=True)]

        kept, out = 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (kept + out)
            if self._wheel_excess(along(middle), velocity, span_s) <= 0.0:
                kept = middle
            else:
                out = middle
        return [*along(kept)[:3], value[3]]

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
