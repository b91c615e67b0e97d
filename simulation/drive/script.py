"""What a scripted person does to the interface: a wrench as a function of time."""

from __future__ import annotations

from math import pi, sin
from typing import Final

import numpy as np

from bridge.config.drive import DriveConfig
from bridge.messages import Floats

_SWING_RAD_S: Final = 4.4  # a pendulum of half a metre, the straps of a harness


def scripted_force(config: DriveConfig, time_s: float) -> Floats:
    """Return the force of the person on the walker `time_s` after the start (3,) [N], support frame.

    `zero`: nothing. `walk`: a forward push and a lean that sway with each step, and a sideward
    sway with every second one. `push`: `walk` with a sideward push for `push_s`. `fall`: `walk`
    until the person falls and hangs in the harness, then `walk` again.
    """
    if config.script == "zero":
        return np.zeros(3)
    since_s = time_s - config.event_s
    if config.script == "fall":
        part = _hanging(config, since_s)
        forward, left, up = _walking(config, time_s)
        load = config.fall_load_n * (0.99 + 0.01 * sin(_SWING_RAD_S * since_s))  # who hangs swings a little
        return np.array([(1.0 - part) * forward, (1.0 - part) * left, (1.0 - part) * up - part * load])
    forward, left, up = _walking(config, time_s)
    if config.script == "push" and 0.0 <= since_s < config.push_s:
        left += config.push_force_n
    return np.array([forward, left, up])


def _walking(config: DriveConfig, time_s: float) -> tuple[float, float, float]:
    """Return the force of a walking person, forward, left, up [N]; the first second eases in."""
    step = 2.0 * pi * config.cadence_hz * time_s
    ease = min(time_s, 1.0)
    forward = config.walk_force_n * (1.0 + 0.3 * sin(step))
    sideward = 0.3 * config.walk_force_n * sin(0.5 * step)
    down = config.walk_lean_n * (1.0 + 0.3 * sin(step + 0.5 * pi))
    return ease * forward, ease * sideward, -ease * down


def _hanging(config: DriveConfig, since_s: float) -> float:
    """Return which part of the person's weight hangs in the harness, 0..1."""
    going_down = since_s / config.fall_rise_s
    standing_up = 1.0 - (since_s - config.fall_rise_s - config.fall_hold_s) / 1.0
    return min(max(min(going_down, standing_up), 0.0), 1.0)
