"""Losing balance: an inverted pendulum over the feet, legs that give way, and lying."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from simulation.kinematic.body import Floats, Posture, add, blend, mirrored, rotation, standing
from simulation.kinematic.events import STEP_S, smooth

GRAVITY: Final = 9.81  # [m/s^2]
SOFT_RAD: Final = np.radians(68.0)  # from here on arms, flesh and floor take the speed out
FLAT_RAD: Final = np.radians(88.0)
DOWN_RAD: Final = np.radians(80.0)  # counts as lying
PUSH_S: Final = 0.30
STIFFNESS: Final = 160.0  # of the ground against toppling [1/s^2]
DAMPING: Final = 26.0  # about critical [1/s]
REST_S: Final = 4.0  # nothing moves after this long

# Degrees for left, right: hip flexion and abduction, knee, ankle, shoulder flexion and abduction, elbow; trunk flexion
# for both alike. 'Left' is a fall to the left; one to the right is its mirror image.
_FOLDED_DEG: Final = {
    "forward": ((30, 24), (4, 4), (70, 58), (5, 5), (70, 60), (20, 16), (40, 48), 14),
    "left": ((50, 38), (4, 8), (76, 60), (10, 10), (48, 40), (26, 34), (42, 55), 14),
    "backward": ((62, 54), (6, 6), (72, 64), (10, 10), (30, 22), (34, 28), (38, 46), 24),
}
_LYING_DEG: Final = {
    "forward": ((4, 0), (10, 12), (10, 16), (-65, -65), (162, 155), (30, 34), (22, 30), 2),
    "left": ((42, 26), (0, 4), (52, 38), (-20, -20), (74, 46), (-4, 6), (52, 70), 8),
    "backward": ((24, 12), (8, 10), (40, 24), (-15, -15), (4, 0), (34, 40), (28, 40), 3),
}


@dataclass(frozen=True, slots=True)
class Fall:
    """Lose balance and topple over the feet with buckling knees, until lying.

    The body turns as an inverted pendulum about the feet, `L a'' = g sin a`, from a push that
    gives it `push_rad_s`; the ground stops it. Its course is like that of the real falls in
    Choi et al. (2015), "Kinematic analysis of video-captured falls experienced by older adults in
    long-term care", J. Biomechanics 48: 1271 (648) ms from loss of balance to pelvis impact, 583 (255) ms
    from the start of the descent to it.
    """

    at_s: float
    direction_rad: float  # 0 forward, pi/2 to the left, pi backward
    length_m: float = 1.15  # of the pendulum: two thirds of the body height, as for a rod
    push_rad_s: float = 0.7
    buckle: float = 1.0  # 0: the legs stay as they were; 1: as in most falls

    def pace(self, time_s: Floats) -> Floats:
        """Walking dies away within a step."""
        return 1.0 - smooth((time_s - self.at_s) / 0.55)

    def topple(self, time_s: Floats) -> Floats:
        """Return the angle of the body (T,) [rad]: the pendulum's until the ground, then at rest."""
        grid_s, angle = self._pendulum()
        return np.interp(time_s - self.at_s, grid_s, angle)

    def attitude(self, time_s: Floats) -> Floats:
        """Return how the whole body is turned (T, 3, 3): toppled, and turning about itself to lie on a side it can."""
        none = np.zeros(len(time_s))
        angle = self.topple(time_s)
        turn = (self.direction_rad - self._rest_rad) * smooth(angle / FLAT_RAD)
        there = rotation(np.stack([none + self.direction_rad, none, none], axis=1))
        toppled = there @ rotation(np.stack([none, angle, none], axis=1)) @ there.swapaxes(1, 2)
        return np.asarray(toppled @ rotation(np.stack([turn, none, none], axis=1)))

    def posture(self, time_s: Floats, before: Posture) -> Posture:
        """Startle, fold the legs on the way down, and come to lie."""
        since_s = time_s - self.at_s
        share = self.topple(time_s) / FLAT_RAD
        frames = len(time_s)
        posture = blend(before, _startled(frames), smooth(since_s / 0.45))
        posture = blend(posture, self._one_of(_FOLDED_DEG, frames, self.buckle), smooth((share - 0.08) / 0.5))
        posture = blend(posture, self._one_of(_LYING_DEG, frames), smooth((since_s - self.ground_s + 0.12) / 0.55))
        breath = standing(frames)
        breath.trunk[:, 1] = np.radians(1.0)
        return add(posture, breath, np.sin(2 * np.pi * 0.3 * since_s) * smooth(since_s - self.ground_s))

    def label(self, time_s: Floats) -> Floats:
        """Return 0 from the loss of balance, 1 once the body is down."""
        return np.where(time_s < self.at_s, -1.0, np.where(time_s < self.at_s + self.ground_s, 0.0, 1.0))

    @property
    def ground_s(self) -> float:
        """From the loss of balance to lying [s]."""
        grid_s, angle = self._pendulum()
        return float(grid_s[np.argmax(angle >= DOWN_RAD)])

    def _pendulum(self) -> tuple[Floats, Floats]:
        """Integrate the fall: times since the loss of balance [s] and angles [rad], until rest."""
        grid_s: Floats = np.arange(round(REST_S / STEP_S), dtype=np.float64) * STEP_S
        push = self.push_rad_s * (1.0 - np.cos(2 * np.pi * grid_s / PUSH_S)) / PUSH_S * (grid_s < PUSH_S)
        angles = np.zeros(len(grid_s))
        angle, speed = 0.0, 0.0
        for index in range(1, len(grid_s)):
            if angle < SOFT_RAD:
                acceleration = GRAVITY / self.length_m * np.sin(angle) + push[index]
            else:
                acceleration = STIFFNESS * (FLAT_RAD - angle) - DAMPING * speed
            speed += acceleration * STEP_S
            angle += speed * STEP_S
            angles[index] = angle
        return grid_s, angles

    @property
    def _rest_rad(self) -> float:
        """Which way the body came to lie: on its front, a side or its back, whichever is nearest."""
        quarter = 0.5 * np.pi
        return float(quarter * np.round(self.direction_rad / quarter))

    def _one_of(self, table: Mapping[str, tuple[object, ...]], frames: int, bend: float = 1.0) -> Posture:
        """Return the posture of this direction."""
        ahead, across = np.cos(self._rest_rad), np.sin(self._rest_rad)
        if abs(across) > 0.5:
            posture = _posture(table["left"], frames, bend)
            return posture if across > 0.0 else mirrored(posture)
        return _posture(table["forward" if ahead > 0.0 else "backward"], frames, bend)


def _posture(row: tuple[object, ...], frames: int, bend: float) -> Posture:
    hip_flexion, hip_abduction, knee, ankle, shoulder_flexion, shoulder_abduction, elbow, trunk = (
        np.radians(np.asarray(angles, dtype=np.float64)) for angles in row
    )
    posture = standing(frames)
    posture.hip[:, :, 0], posture.hip[:, :, 1] = bend * hip_flexion, hip_abduction
    posture.knee[:], posture.ankle[:] = bend * knee, ankle
    posture.shoulder[:, :, 0], posture.shoulder[:, :, 1] = shoulder_flexion, shoulder_abduction
    posture.elbow[:] = elbow
    posture.trunk[:, 1] = trunk
    return posture


def _startled(frames: int) -> Posture:
    """Arms up and out, knees giving way: the first tenths of a second after balance is lost."""
    posture = standing(frames)
    posture.shoulder[:, :, 0], posture.shoulder[:, :, 1] = np.radians(35.0), np.radians(40.0)
    posture.elbow[:] = np.radians(40.0)
    posture.hip[:, :, 0], posture.knee[:], posture.ankle[:] = np.radians(16.0), np.radians(24.0), np.radians(8.0)
    posture.trunk[:, 1] = np.radians(10.0)
    return posture
