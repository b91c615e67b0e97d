"""Segment lengths of a person and where the joints are for given angles.

World and body frames: x forward, y left, z up [m]. Segment lengths are fractions of
body height after Drillis and Contini (1966), "Body segment parameters", as given in
Winter (2009), "Biomechanics and Motor Control of Human Movement", 4th ed., figure 4.1.
Shoulder and hip widths are those between the joint centres that estimators report,
which lie inside the outer breadths (0.259 and 0.191) of that figure.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ANKLE_HEIGHT: Final = 0.039
SHANK: Final = 0.285 - 0.039
THIGH: Final = 0.530 - 0.285
TRUNK: Final = 0.818 - 0.530  # hip to shoulder
UPPER_ARM: Final = 0.186
FOREARM: Final = 0.146
FOOT: Final = 0.152
HEEL: Final = 0.25  # share of the foot behind the ankle
SHOULDER_WIDTH: Final = 0.200
HIP_WIDTH: Final = 0.120

SIDES: Final = np.array([1.0, -1.0])  # left is positive y

FLESH: Final = np.array([0.045] * 2 + [0.025] * 4 + [0.055] * 2 + [0.033] * 2 + [0.026] * 2 + [0.0] * 4)
"""(16,) distance from a joint centre, heel or toe to the skin below it, as a fraction of body height; assumed."""


class Posture(NamedTuple):
    """Joint angles over time [rad], zero when standing straight with hanging arms; pairs are left, right."""

    pelvis: Floats  # (T, 3) turn to the left, tilt forward, lean to the right, in this order
    trunk: Floats  # (T, 3) the same for the shoulders relative to the pelvis
    hip: Floats  # (T, 2, 2) side; flexion, abduction
    knee: Floats  # (T, 2) flexion
    ankle: Floats  # (T, 2) dorsiflexion
    shoulder: Floats  # (T, 2, 2) side; flexion, abduction
    elbow: Floats  # (T, 2) flexion


class Points(NamedTuple):
    """Where a body is, relative to the middle of the hips [m]."""

    keypoints: Floats  # (T, 12, 3) in the order of perception.skeleton
    feet: Floats  # (T, 4, 3) left heel, right heel, left toe, right toe

    @property
    def everything(self) -> Floats:
        """(T, 16, 3) keypoints, then feet, in the order of `FLESH`."""
        return np.concatenate([self.keypoints, self.feet], axis=1)


def standing(frames: int) -> Posture:
    """Return a posture of all zeros over `frames` frames."""
    return Posture(*(np.zeros((frames, *shape)) for shape in ((3,), (3,), (2, 2), (2,), (2,), (2, 2), (2,))))


def blend(one: Posture, other: Posture, weight: Floats) -> Posture:
    """Return `one` where `weight` (T,) is 0 and `other` where it is 1."""
    return Posture(*(_mix(a, b, weight) for a, b in zip(one, other, strict=True)))


def add(one: Posture, other: Posture, weight: Floats | float = 1.0) -> Posture:
    """Return `one` plus `weight` (T,) times `other`."""
    amount = np.broadcast_to(np.asarray(weight, dtype=np.float64), (len(one.pelvis),))
    return Posture(*(a + _along(amount, a) * b for a, b in zip(one, other, strict=True)))


def mirrored(posture: Posture) -> Posture:
    """Exchange left and right."""
    across = np.array([-1.0, 1.0, -1.0])
    return Posture(
        posture.pelvis * across,
        posture.trunk * across,
        posture.hip[:, ::-1],
        posture.knee[:, ::-1],
        posture.ankle[:, ::-1],
        posture.shoulder[:, ::-1],
        posture.elbow[:, ::-1],
    )


def points(posture: Posture, height_m: float, attitude: Floats) -> Points:
    """Return the keypoints of a body of `height_m` by forward kinematics.

    Args:
        posture: over T frames.
        height_m: body height [m].
        attitude: (T, 3, 3) rotation from the upright body to the world: heading and toppling.
    """
    pelvis = attitude @ rotation(posture.pelvis)
    chest = pelvis @ rotation(posture.trunk)
    limbs = {name: np.empty((len(pelvis), 2, 3)) for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")}
    heel, toe = np.empty((len(pelvis), 2, 3)), np.empty((len(pelvis), 2, 3))
    for side, sign in enumerate(SIDES):
        shoulder = chest @ np.array([0.0, sign * SHOULDER_WIDTH / 2, TRUNK])
        upper_arm = chest @ _roll(sign * posture.shoulder[:, side, 1]) @ _tilt(-posture.shoulder[:, side, 0])
        forearm = upper_arm @ _tilt(-posture.elbow[:, side])
        elbow = shoulder + upper_arm @ np.array([0.0, 0.0, -UPPER_ARM])
        hip = pelvis @ np.array([0.0, sign * HIP_WIDTH / 2, 0.0])
        thigh = pelvis @ _roll(sign * posture.hip[:, side, 1]) @ _tilt(-posture.hip[:, side, 0])
        shank = thigh @ _tilt(posture.knee[:, side])
        knee = hip + thigh @ np.array([0.0, 0.0, -THIGH])
        ankle = knee + shank @ np.array([0.0, 0.0, -SHANK])
        foot = shank @ _tilt(-posture.ankle[:, side])
        limbs["shoulder"][:, side], limbs["elbow"][:, side] = shoulder, elbow
        limbs["wrist"][:, side] = elbow + forearm @ np.array([0.0, 0.0, -FOREARM])
        limbs["hip"][:, side], limbs["knee"][:, side], limbs["ankle"][:, side] = hip, knee, ankle
        heel[:, side] = ankle + foot @ np.array([-HEEL * FOOT, 0.0, -ANKLE_HEIGHT])
        toe[:, side] = ankle + foot @ np.array([(1 - HEEL) * FOOT, 0.0, -ANKLE_HEIGHT])
    keypoints = np.concatenate(list(limbs.values()), axis=1)
    return Points(keypoints * height_m, np.concatenate([heel, toe], axis=1) * height_m)


def rotation(angles: Floats) -> Floats:
    """Return the rotations (T, 3, 3) of (T, 3) turn to the left, tilt forward and lean to the right [rad]."""
    return _turn(angles[:, 0]) @ _tilt(angles[:, 1]) @ _roll(angles[:, 2])


def _turn(angle: Floats) -> Floats:
    return _about(angle, 0, 1)


def _tilt(angle: Floats) -> Floats:
    return _about(angle, 2, 0)


def _roll(angle: Floats) -> Floats:
    return _about(angle, 1, 2)


def _about(angle: Floats, first: int, second: int) -> Floats:
    """Rotation that carries axis `first` towards axis `second`."""
    turned = np.broadcast_to(np.eye(3), (len(angle), 3, 3)).copy()
    turned[:, first, first] = turned[:, second, second] = np.cos(angle)
    turned[:, second, first] = np.sin(angle)
    turned[:, first, second] = -np.sin(angle)
    return turned


def _along(weight: Floats, array: Floats) -> Floats:
    return weight.reshape(-1, *([1] * (array.ndim - 1)))


def _mix(one: Floats, other: Floats, weight: Floats) -> Floats:
    return one + _along(weight, one) * (other - one)
