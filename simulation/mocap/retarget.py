"""From keypoints to the joint angles of a body of another size.

Feet go where the clip's ankles go, scaled by the length of the legs; knees and hips follow by inverse kinematics.
Twelve keypoints say nothing of toes: soles are level, except that a heel that rises while the foot stays turns about
its toes.
"""

from __future__ import annotations

from math import asin, atan2, cos, sin
from typing import Final, NamedTuple

import numpy as np

from bridge.messages import Floats
from simulation.mocap.clip import Clip, leg_length
from simulation.person.anthropometry import BodySize
from simulation.person.leg import leg_angles
from simulation.person.posture import HIP_SHARE

REACH: Final = 0.99  # longest leg, of the stretched one
TIPTOE_RAD: Final = 0.7
FLIGHT_M: Final = 0.12  # both ankles that high above standing: nobody stands
CLEAR_M: Final = 0.02  # more than the clip's, under a foot in the air
SHOULDERS: Final = (0, 1)
ELBOWS: Final = (2, 3)
WRISTS: Final = (4, 5)


class Track(NamedTuple):
    """A clip on a body; T frames, each turned and moved so that the first stands at the origin and faces +x."""

    fps_hz: float
    hips_m: Floats  # (T, 3) middle of the hip joints
    heading_rad: Floats  # (T,) continuous
    pitch_rad: Floats  # (T,) forward bend of the trunk
    legs_rad: Floats  # (T, 2, 6) left and right, as simulation.person.body.LEG_JOINTS
    upper_rad: Floats  # (T, 9), as simulation.person.body.UPPER_JOINTS
    load: Floats  # (T, 2) share of the weight on the left and right foot; 0 for a foot in the air

    def at(self, time_s: float) -> Track:
        """Return the values at `time_s`: a track without its first axis."""
        place = min(max(time_s * self.fps_hz, 0.0), len(self.hips_m) - 1.0)
        before = min(int(place), len(self.hips_m) - 2)
        share = place - before
        values = [(1.0 - share) * column[before] + share * column[before + 1] for column in self[1:]]
        return Track(self.fps_hz, *values)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame [s]."""
        return (len(self.hips_m) - 1) / self.fps_hz


def retarget(clip: Clip, size: BodySize) -> Track:
    """Return `clip` as motion of a body of `size`."""
    p = clip.points_m
    scale = size.leg_m / leg_length(p)
    hips, shoulders = p[:, 6:8].mean(axis=1), p[:, 0:2].mean(axis=1)
    across = p[:, 6] - p[:, 7]
    heading = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
    start, turn = hips[0, :2].copy(), heading[0]
    heading = heading - turn
    local = _turned(p - np.array([*start, 0.0]), -turn)  # in the frame that the first frame faces
    middle = local[:, 6:8].mean(axis=1)
    ankle_z = size.ankle_height_m
    way = np.column_stack((scale * middle[:, :2], scale * middle[:, 2] + ankle_z))
    pitch = np.empty(len(p))
    legs, upper = np.empty((len(p), 2, 6)), np.empty((len(p), 9))
    pace = scale * np.linalg.norm(np.gradient(local[:, 10:12, :2], axis=0), axis=-1) * clip.fps_hz
    for k in range(len(p)):
        own = _turned(local[k] - middle[k], -heading[k])  # (12, 3) from the middle of the hips, facing +x
        trunk = _unit(_turned((shoulders[k] - hips[k])[None], -turn - heading[k])[0])
        pitch[k] = atan2(trunk[0], max(trunk[2], 0.05))
        lean = HIP_SHARE * pitch[k]
        pelvis = _about_y(lean)
        for side, sign in ((0, 1.0), (1, -1.0)):
            hip = np.array([0.0, sign * size.hip_half_width_m, 0.0])
            # hips of another width: the leg keeps its direction
            ankle = hip + scale * (own[10 + side] - own[6 + side])
            risen = scale * local[k, 10 + side, 2]
            sole = _about_y(_tiptoe(risen, float(pace[k, side]), size))
            ankle[2] += CLEAR_M * min(risen / 0.05, 1.0) if risen > 0.0 else 0.0
            legs[k, side] = leg_angles(pelvis.T @ ankle, pelvis.T @ sole, hip, size.thigh_m, size.shank_m, REACH)
        upper[k] = _upper(own, trunk, lean)
    return Track(clip.fps_hz, way, heading, pitch, legs, upper, _loads(scale * local[:, 10:12], way))


def _upper(own: Floats, trunk: Floats, lean: float) -> Floats:
    """Return the nine angles of back and arms of points (12, 3) that face +x."""
    t = _about_y(-lean) @ trunk
    roll = -asin(min(max(float(t[1]), -1.0), 1.0))
    pitch = atan2(t[0], t[2])
    torso = _about_y(lean) @ _about_y(pitch) @ _about_x(roll)
    across = torso.T @ _unit(own[0] - own[1])
    yaw = atan2(-across[0], across[1])
    torso = torso @ _about_z(yaw)
    angles = np.zeros(9)
    angles[:3] = pitch, roll, yaw
    for side in (0, 1):
        arm = torso.T @ _unit(own[ELBOWS[side]] - own[SHOULDERS[side]])
        fore = torso.T @ _unit(own[WRISTS[side]] - own[ELBOWS[side]])
        angles[3 + side] = atan2(-arm[0], -arm[2])
        angles[5 + side] = asin(min(max(float(arm[1]), -1.0), 1.0))
        angles[7 + side] = -np.arccos(min(max(float(arm @ fore), -1.0), 1.0))
    return angles


def _tiptoe(risen_m: float, pace_m_s: float, size: BodySize) -> float:
    """Return the pitch of a sole whose ankle is `risen_m` above standing: about its toes while it does not move on."""
    still = min(max(1.0 - pace_m_s / 0.6, 0.0), 1.0)
    return still * min(asin(min(max(risen_m / (0.75 * size.foot_m), 0.0), 1.0)), TIPTOE_RAD)


def _loads(ankles: Floats, hips: Floats) -> Floats:
    """Return the share of the weight on each foot (T, 2), from heights and distances of ankles (T, 2, 3) [m]."""
    weight = np.exp(-np.maximum(ankles[..., 2], 0.0) / 0.02)
    weight /= 0.05 + np.linalg.norm(ankles[..., :2] - hips[:, None, :2], axis=-1)
    share = weight / weight.sum(axis=1, keepdims=True)
    share[ankles[..., 2].min(axis=1) > FLIGHT_M] = 0.0
    return np.where(share < 0.1, 0.0, share)


def _turned(points: Floats, angle: float) -> Floats:
    result: Floats = points @ _about_z(angle).T
    return result


def _unit(vector: Floats) -> Floats:
    result: Floats = vector / max(float(np.linalg.norm(vector)), 1e-9)
    return result


def _about_x(angle: float) -> Floats:
    c, s = cos(angle), sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle: float) -> Floats:
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _about_z(angle: float) -> Floats:
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
