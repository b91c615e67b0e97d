"""A person's whole motion in the world: gait, events, heading, and feet that stay on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from simulation.kinematic import gait
from simulation.kinematic.body import FLESH, Floats, Points, Posture, add, points, standing
from simulation.kinematic.events import STEP_S, Event, smooth, upright

SOFTNESS_M: Final = 0.008  # over which the contact passes from one point of the body to the next


@dataclass(frozen=True, slots=True)
class Walker:
    """Who walks, and how."""

    height_m: float = 1.72
    speed_m_s: float = 0.9
    variability: float = 1.0  # 0: every stride the same; 1: like a healthy adult's


class Motion(NamedTuple):
    """Where the person is at each time."""

    time_s: Floats  # (T,)
    keypoints_m: Floats  # (T, 12, 3)
    feet_m: Floats  # (T, 4, 3) left heel, right heel, left toe, right toe
    hips_m: Floats  # (T, 3) middle of the hips
    label: Floats  # (T,) -1 stable, 0 falling, 1 lying


def move(walker: Walker, events: Sequence[Event], duration_s: float, rng: np.random.Generator) -> Motion:
    """Return the motion over `duration_s` on the grid of `STEP_S`; it begins in full walk along x."""
    time_s: Floats = np.arange(round(duration_s / STEP_S) + 1, dtype=np.float64) * STEP_S
    pace = np.prod([np.ones(len(time_s)), *(event.pace(time_s) for event in events)], axis=0)
    wander = _Wander(time_s, rng)
    tempo = 1.0 + 0.025 * walker.variability * wander.next(0.35)  # stride time varies by 2 to 3 % in healthy adults
    stride_hz = 0.5 * gait.cadence(walker.speed_m_s, walker.height_m)
    phase = float(rng.random()) + np.cumsum(pace * tempo) * STEP_S * stride_hz
    amplitude = gait.stride_amplitude(walker.speed_m_s, walker.height_m)
    posture = gait.walking(phase, amplitude)
    posture = add(posture, _restless(wander), walker.variability)
    for event in events:
        posture = event.posture(time_s, posture)
    body = points(posture, walker.height_m, _attitude(events, time_s))
    walked = np.cumsum(pace * tempo) * STEP_S * walker.speed_m_s
    path = np.stack([walked, gait.sway(phase) * np.clip(pace, 0.0, 1.0)], axis=1)
    path = path - _held_feet(body, events, time_s)
    hips = np.concatenate([path, _support_height(body, walker.height_m)[:, None]], axis=1)
    label = np.max([np.full(len(time_s), -1.0), *(event.label(time_s) for event in events)], axis=0)
    return Motion(time_s, body.keypoints + hips[:, None], body.feet + hips[:, None], hips, label)


def _attitude(events: Sequence[Event], time_s: Floats) -> Floats:
    attitude = upright(len(time_s))
    for event in events:
        attitude = event.attitude(time_s) @ attitude
    return attitude


def _held_feet(body: Points, events: Sequence[Event], time_s: Floats) -> Floats:
    """Return how far to shift the hips back (T, 2) so that the feet stay where they were when walking ended.

    Feet walk on with the path; from an event that ends walking on, the middle between them no longer
    moves relative to it.
    """
    ankles = body.keypoints[:, 10:12, :2].mean(axis=1)
    endings = [event.at_s for event in events if event.pace(np.array([event.at_s + 60.0]))[0] < 0.5]
    if not endings:
        return np.zeros_like(ankles)
    ended_s = min(endings)
    start = min(int(np.searchsorted(time_s, ended_s)), len(ankles) - 1)
    return np.asarray(smooth((time_s - ended_s) / 0.25)[:, None] * (ankles - ankles[start]))


def _support_height(body: Points, height_m: float) -> Floats:
    """Return the height of the hips (T,) [m] with the body's lowest point on the floor.

    The minimum is a soft one, so that the contact does not jump from point to point.
    """
    depth = FLESH * height_m - body.everything[..., 2]  # (T, 16) how far each point's skin is below the hips
    deepest: Floats = depth.max(axis=1)
    excess: Floats = np.exp((depth - deepest[:, None]) / SOFTNESS_M).sum(axis=1)
    return np.asarray(deepest + SOFTNESS_M * np.log(excess))


def _restless(wander: _Wander) -> Posture:
    """Return what differs from stride to stride [rad]."""
    posture = standing(wander.frames)
    for angles, size_deg in (
        (posture.pelvis, 0.8),
        (posture.trunk, 1.2),
        (posture.hip, 1.0),
        (posture.knee, 1.0),
        (posture.ankle, 0.6),
        (posture.shoulder, 2.2),
        (posture.elbow, 3.0),
    ):
        flat = angles.reshape(wander.frames, -1)
        for column in range(flat.shape[1]):
            flat[:, column] = np.radians(size_deg) * wander.next(0.9)
    return posture


class _Wander:
    """Smooth random functions of time with unit variance, one after the other from one generator."""

    def __init__(self, time_s: Floats, rng: np.random.Generator) -> None:
        self._time_s, self._rng = time_s, rng
        self.frames = len(time_s)

    def next(self, highest_hz: float) -> Floats:
        """Return a sum (T,) of eight waves of random phase and of frequencies up to `highest_hz`."""
        frequency = highest_hz * (np.arange(8) + self._rng.random(8)) / 8.0
        phase = 2 * np.pi * self._rng.random(8)
        waves = np.cos(2 * np.pi * frequency * self._time_s[:, None] + phase)
        return np.asarray(0.5 * waves.sum(axis=1))
