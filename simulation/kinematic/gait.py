"""Walking: joint angles as harmonic series of the gait phase, step length and cadence from speed.

The angles run through rounded norm values of healthy adults at natural cadence, at tenths of the
stride from heel strike to heel strike (Winter, 1991, "The Biomechanics and Motor Control of Human Gait";
Perry and Burnfield, 2010, "Gait Analysis"). Ten samples hold five harmonics, which carry over 99 % of the
power of these angles (Winter, 2009, chapter 2).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from simulation.kinematic.body import Floats, Posture, points, standing

HIP_DEG: Final = (21.0, 17.0, 10.0, 2.0, -5.0, -10.0, -4.0, 10.0, 21.0, 24.0)
KNEE_DEG: Final = (4.0, 17.0, 18.0, 12.0, 7.0, 12.0, 37.0, 62.0, 55.0, 23.0)
ANKLE_DEG: Final = (0.0, -3.0, 3.0, 7.0, 9.0, 6.0, -12.0, -15.0, -4.0, 1.0)

WALK_RATIO: Final = 0.0065
"""Step length over cadence [m min], nearly constant over speeds in one adult (Sekiya et al., 1996, "The invariant
relationship between step length and step rate during free walking", J. Human Movement Studies 30)."""

REFERENCE_HEIGHT_M: Final = 1.75  # of the people the walk ratio and the angles come from

TURN_RAD: Final = np.radians(4.0)  # pelvis about the vertical, forward with the leg in front
LIST_RAD: Final = np.radians(3.5)  # pelvis drops towards the swinging leg
ARM_RAD: Final = np.radians(14.0)
SWAY_M: Final = 0.02  # of the body towards the standing leg


def series(samples: tuple[float, ...]) -> Floats:
    """Return the complex harmonics (H,) of the periodic curve through evenly spaced `samples`."""
    harmonics = np.fft.rfft(np.asarray(samples)) / len(samples)
    harmonics[1:] *= 2.0
    if len(samples) % 2 == 0:
        harmonics[-1] *= 0.5  # the last harmonic of an even number of samples is its own mirror image
    return harmonics  # type: ignore[return-value]


def evaluate(harmonics: Floats, phase: Floats) -> Floats:
    """Return the curve of `series` at `phase`, in strides."""
    order = np.arange(len(harmonics))
    return np.asarray((harmonics * np.exp(2j * np.pi * order * phase[..., None])).real.sum(axis=-1))


def step_length(speed_m_s: float, height_m: float) -> float:
    """Return the step length [m] at a walking speed: `v = length * cadence`, `length = ratio * cadence`."""
    ratio = WALK_RATIO * height_m / REFERENCE_HEIGHT_M
    return float(np.sqrt(speed_m_s * 60.0 * ratio))


def cadence(speed_m_s: float, height_m: float) -> float:
    """Return the steps per second at a walking speed."""
    return speed_m_s / step_length(speed_m_s, height_m)


def walking(phase: Floats, amplitude: float) -> Posture:
    """Return the posture at gait `phase` (T,), in strides from the left heel's strike.

    Args:
        phase: counts strides; may be any real number.
        amplitude: scales the swing of the hips and what goes with it; 1 at natural cadence.
    """
    both = np.stack([phase, phase + 0.5], axis=1)
    hip_curve, knee_curve, ankle_curve = (series(curve) for curve in (HIP_DEG, KNEE_DEG, ANKLE_DEG))
    swing = np.radians(evaluate(hip_curve, both))
    middle = np.radians(np.mean(HIP_DEG))
    posture = standing(len(phase))
    posture.hip[:, :, 0] = middle + amplitude * (swing - middle)
    posture.hip[:, :, 1] = np.radians(1.5)
    posture.knee[:] = np.radians(evaluate(knee_curve, both)) * (0.4 + 0.6 * min(amplitude, 1.2))
    posture.ankle[:] = np.radians(evaluate(ankle_curve, both)) * min(amplitude, 1.2)
    forward = np.cos(2 * np.pi * phase)  # +1 when the left leg is in front
    posture.pelvis[:, 0] = -TURN_RAD * amplitude * forward
    posture.pelvis[:, 1] = np.radians(4.0)
    posture.pelvis[:, 2] = LIST_RAD * amplitude * np.sin(2 * np.pi * phase)
    posture.trunk[:, 0] = 2.0 * TURN_RAD * amplitude * forward  # shoulders turn against the pelvis
    posture.trunk[:, 1] = np.radians(2.0)
    posture.trunk[:, 2] = -posture.pelvis[:, 2]
    arms = np.stack([-forward, forward], axis=1)
    posture.shoulder[:, :, 0] = np.radians(4.0) + ARM_RAD * amplitude * arms
    posture.shoulder[:, :, 1] = np.radians(7.0)
    posture.elbow[:] = np.radians(22.0) + np.radians(8.0) * amplitude * arms
    return posture


def sway(phase: Floats) -> Floats:
    """Return how far the body is to the left (T,) [m]: over the standing leg."""
    return np.asarray(SWAY_M * np.sin(2 * np.pi * phase))


def stride_amplitude(speed_m_s: float, height_m: float) -> float:
    """Return the amplitude with which `walking` makes steps of `step_length` at `speed_m_s`.

    The step is the distance between the ankles at heel strike.
    """
    wanted = step_length(speed_m_s, height_m)
    low, high = 0.0, 2.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _ankle_distance(middle, height_m) < wanted else (low, middle)
    return 0.5 * (low + high)


def _ankle_distance(amplitude: float, height_m: float) -> float:
    pose = points(walking(np.zeros(1), amplitude), height_m, np.eye(3)[None])
    return float(pose.keypoints[0, 10, 0] - pose.keypoints[0, 11, 0])
