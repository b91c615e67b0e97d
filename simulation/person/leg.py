"""Inverse kinematics of a leg: hip yaw, roll, pitch, knee, ankle pitch, roll.

The closed form for legs whose hip and ankle axes meet in a point each: S. Kajita et al.,
'Introduction to Humanoid Robotics', Springer 2014, section 2.5.
"""

from __future__ import annotations

from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from bridge.messages import Floats

REACH = 0.998  # of the stretched leg: beyond it the knee would lock


def leg_angles(
    ankle: Floats, rotation: Floats, hip: Floats, thigh_m: float, shank_m: float, reach: float = REACH
) -> Floats:
    """Return the six joint angles [rad] that put the foot there; a target out of reach is drawn in towards the hip.

    Args:
        ankle: position of the ankle in the pelvis frame, (3,) [m].
        rotation: orientation of the foot in the pelvis frame, (3, 3).
        hip: position of the hip joint in the pelvis frame, (3,) [m].
        thigh_m: hip to knee [m].
        shank_m: knee to ankle [m].
        reach: longest leg, of the stretched one.
    """
    x, y, z = (rotation.T @ (hip - ankle)).tolist()
    length = sqrt(x * x + y * y + z * z)
    longest = reach * (thigh_m + shank_m)
    if length > longest:
        x, y, z, length = x * longest / length, y * longest / length, z * longest / length, longest
    bend = (thigh_m**2 + shank_m**2 - length**2) / (2.0 * thigh_m * shank_m)
    knee = pi - acos(min(max(bend, -1.0), 1.0))
    ankle_roll = atan2(y, z)
    lean = asin(min(max(thigh_m * sin(pi - knee) / length, -1.0), 1.0))
    ankle_pitch = -atan2(x, (1.0 if z >= 0 else -1.0) * hypot(y, z)) - lean
    # rotation of the thigh: R Rx(-ankle_roll) Ry(-knee - ankle_pitch)
    cr, sr = cos(ankle_roll), sin(ankle_roll)
    turn = knee + ankle_pitch
    ct, st = cos(turn), sin(turn)
    lower = np.array([[ct, 0.0, -st], [sr * st, cr, sr * ct], [cr * st, -sr, cr * ct]])
    thigh = rotation @ lower
    yaw = atan2(-thigh[0, 1], thigh[1, 1])
    roll = asin(min(max(thigh[2, 1], -1.0), 1.0))
    pitch = atan2(-thigh[2, 0], thigh[2, 2])
    return np.array([yaw, roll, pitch, knee, ankle_pitch, ankle_roll])
