"""Coordinates that do not depend on where a person is in the image, nor on how far away."""

from __future__ import annotations

import math
from collections import deque
from enum import IntEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bridge.config.perception import BodyScaleConfig
from bridge.messages import Floats
from perception.skeleton import (
    L_ANKLE,
    L_HIP,
    L_KNEE,
    L_SHOULDER,
    R_ANKLE,
    R_HIP,
    R_KNEE,
    R_SHOULDER,
)

LEG_PER_TRUNK: Final = (0.530 - 0.039) / (0.818 - 0.530)
"""Hip to ankle over shoulder to hip, from body heights of 0.818, 0.530 and 0.039 (Winter, 2009,
"Biomechanics and Motor Control of Human Movement", 4th ed., figure 4.1)."""

_LEGS: Final = ((L_HIP, L_KNEE, L_ANKLE), (R_HIP, R_KNEE, R_ANKLE))
_STRETCHED: Final = 0.85  # share of the body length that is vertical in one who stands
_SHORTEST_LEG: Final = 1.1  # leg over trunk of one who does not sit facing the camera
_BROADEST: Final = 0.9  # shoulder width over trunk length of one who is not foreshortened (Winter: 0.259 / 0.288)
_MEDIAN_OF: Final = 5  # measurements; two wrong ones in a row change nothing
_LONGEST_STEP_S: Final = 0.1  # a gap between frames is no evidence that the person shrank


def _middle(left: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Mean of two points (..., 2); where one is NaN, the other."""
    left = np.where(np.isnan(left), right, left)
    right = np.where(np.isnan(right), left, right)
    middle: NDArray[Any] = (left + right) * 0.5
    return middle


def upper_body_centre(position_px: NDArray[Any]) -> NDArray[Any]:
    """Mean of shoulders and hips.

    A lost shoulder or hip is replaced by the one of the other side; with both lost
    the centre is NaN.

    Args:
        position_px: (..., 12, 2), NaN where lost [px].

    Returns:
        (..., 2) [px].
    """
    shoulders = _middle(position_px[..., L_SHOULDER, :], position_px[..., R_SHOULDER, :])
    hips = _middle(position_px[..., L_HIP, :], position_px[..., R_HIP, :])
    centre: NDArray[Any] = (shoulders + hips) * 0.5
    return centre


def relative(position_px: NDArray[Any], body_length: float | NDArray[Any]) -> NDArray[Any]:
    """Coordinates from the upper-body centre, in body lengths.

    Args:
        position_px: (..., 12, 2), NaN where lost [px].
        body_length: scalar or (...), as from `BodyScale` [px].

    Returns:
        (..., 12, 2) [body lengths], NaN where lost.
    """
    centre = upper_body_centre(position_px)[..., None, :]
    length = np.asarray(body_length, dtype=position_px.dtype)[..., None, None]
    scaled: NDArray[Any] = (position_px - centre) / length
    return scaled


class _Posture(IntEnum):
    """What a smaller measurement says about the person."""

    OTHER = 0  # lying, bent: foreshortened, says nothing
    UPRIGHT = 1  # trunk upright, legs hidden or bent: may be sitting, may be further away
    STANDING = 2  # stretched out upright: further away


class BodyScale:
    """Shoulder-hip-knee-ankle length of one person in the image, adapting slowly.

    One frame's measurement is foreshortened when the person bends, turns or lies
    along the line of sight, but never lengthened. So the length follows larger
    measurements (coming nearer) within `grow_s`, or within `stand_s` where the trunk
    is not upright, because detectors err most on people who lie. Smaller ones it
    follows within `stand_s` while the person plainly stands, within `shrink_s` while
    at least the trunk is upright in the image, and otherwise not at all: lying down
    shrinks nobody. A running median keeps single wrong frames out.
    """

    def __init__(self, config: BodyScaleConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Forget the person."""
        self._length = math.nan
        self._first_s = math.nan
        self._last_s = math.nan
        self._settling: list[float] = []
        self._recent: deque[float] = deque(maxlen=_MEDIAN_OF)

    @property
    def length_px(self) -> float:
        """Body length [px]; NaN before the first measurement."""
        return self._length

    def update(self, position_px: Floats, time_s: float) -> float:
        """Take in one frame's measured points and return the body length [px].

        Args:
            position_px: (12, 2), NaN where nothing was measured [px].
            time_s: time of the frame on any clock that does not run backwards [s].
        """
        measured, posture = _measure(position_px)
        if math.isnan(measured):
            return self._length
        if math.isnan(self._first_s):
            self._first_s = self._last_s = time_s
        step_s = min(time_s - self._last_s, _LONGEST_STEP_S)
        self._last_s = time_s
        self._recent.append(measured)
        if time_s - self._first_s <= self._config.settle_s:
            self._settling.append(measured)
            self._length = _median(self._settling)
            return self._length
        recent = _median(self._recent)
        if recent > self._length:
            follow_s = self._config.stand_s if posture is _Posture.OTHER else self._config.grow_s
        elif posture is _Posture.STANDING:
            follow_s = self._config.stand_s
        elif posture is _Posture.UPRIGHT:
            follow_s = self._config.shrink_s
        else:
            return self._length
        self._length += (recent - self._length) * -math.expm1(-step_s / follow_s)
        return self._length


def _median(values: list[float] | deque[float]) -> float:
    """Lower median: one of the values, so that it scales with them exactly."""
    return sorted(values)[(len(values) - 1) // 2]


def _measure(position_px: Floats) -> tuple[float, _Posture]:
    """Body length in one frame [px], NaN if too little is in view, and the posture.

    With only trunk or only legs in view the other is added in Winter's proportion.
    """
    points: list[list[float]] = position_px.tolist()
    shoulder_x, shoulder_y = _mean(points[L_SHOULDER], points[R_SHOULDER])
    hip_x, hip_y = _mean(points[L_HIP], points[R_HIP])
    trunk = math.hypot(hip_x - shoulder_x, hip_y - shoulder_y)
    leg = leg_down = math.nan
    for hip, knee, ankle in _LEGS:
        length = math.dist(points[hip], points[knee]) + math.dist(points[knee], points[ankle])
        if length > leg or math.isnan(leg):
            leg = length
            leg_down = points[ankle][1] - points[hip][1]
    if math.isnan(trunk):
        length = leg * (1.0 + 1.0 / LEG_PER_TRUNK)
    elif math.isnan(leg):
        length = trunk * (1.0 + LEG_PER_TRUNK)
    else:
        length = trunk + leg
    if not length > 0.0:
        return math.nan, _Posture.OTHER
    trunk_down = hip_y - shoulder_y
    if not trunk_down > abs(hip_x - shoulder_x):
        return length, _Posture.OTHER
    width = math.dist(points[L_SHOULDER], points[R_SHOULDER])
    stretched = trunk_down + leg_down > _STRETCHED * length
    if stretched and leg > _SHORTEST_LEG * trunk and width < _BROADEST * trunk:
        return length, _Posture.STANDING
    return length, _Posture.UPRIGHT


def _mean(left: list[float], right: list[float]) -> tuple[float, float]:
    """Mean of two points; where one is NaN, the other."""
    if math.isnan(left[0]):
        left = right
    elif math.isnan(right[0]):
        right = left
    return (left[0] + right[0]) * 0.5, (left[1] + right[1]) * 0.5
