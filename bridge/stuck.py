"""Telling a sensor that lives from one that repeats itself under new stamps.

What is measured has noise: values that stay the same to the last bit, sample after sample, come from a camera that
delivers one picture again and again, a driver that publishes its last reading, a loop that
computes on an input that stands still. Stamps and numbers say nothing of it, the values do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from bridge.clock import NS
from bridge.errors import InvalidMessage
from bridge.messages import FallHorizon, Keypoints, KeypointStatus, Message, Odometry, Wrench

_SAME_PX: Final = 1e-6  # the cleaning's low-pass still settles by less than this 0.7 s after its input stood still
_MOVING: Final = 0.01  # speed from which a pose must change [m/s, rad/s]


class StuckWatch:
    """Judges one stream: how long, by its own stamps, it has repeated one measurement."""

    def __init__(self, name: str, limit_s: float) -> None:
        """Start without a past.

        Args:
            name: of the stream, for the reason.
            limit_s: how long the values may stay the same [s]; 0 = as long as they like.
        """
        self._name, self._limit_s = name, limit_s
        self._first: Message | None = None  # of those with the present values

    def judge(self, message: Message) -> None:
        """Take note of the next message of the stream.

        Raises:
            InvalidMessage: its values have been the same for too long.
        """
        if self._limit_s == 0.0:
            return
        first = self._first
        if first is None or not _repeats(first, message):
            self._first = message
            return
        still_s = (message.stamp_ns - first.stamp_ns) / NS
        if still_s > self._limit_s:
            raise InvalidMessage(
                f"{self._name} is stuck: the same values for {still_s * 1e3:.0f} ms, limit {self._limit_s * 1e3:.0f}"
            )


def _repeats(first: Message, message: Message) -> bool:
    """Whether `message` says what `first` said and a living sensor would not say again."""
    same = _SAME.get(type(message))
    return same is not None and bool(same(first, message))


def _same_keypoints(a: Keypoints, b: Keypoints) -> bool:
    seen = a.status != KeypointStatus.LOST
    if not seen.any() or (a.status != b.status).any():
        return False
    return bool(np.abs(a.position_px[seen] - b.position_px[seen]).max() <= _SAME_PX)


def _same_horizon(a: FallHorizon, b: FallHorizon) -> bool:
    return np.array_equal(a.probabilities, b.probabilities) and np.array_equal(a.distance, b.distance)


def _same_wrench(a: Wrench, b: Wrench) -> bool:
    """An unloaded interface that is simulated, or has a dead band, says exactly zero while nobody touches it."""
    loaded = bool(a.force.any() or a.torque.any())
    return loaded and np.array_equal(a.force, b.force) and np.array_equal(a.torque, b.torque)


def _same_odometry(a: Odometry, b: Odometry) -> bool:
    """At rest encoders count nothing; while there is speed the pose must change."""
    moving = max(float(np.abs(a.velocity).max()), abs(a.yaw_rate)) > _MOVING
    return moving and np.array_equal(a.position, b.position) and a.yaw == b.yaw


_SAME: Final[dict[type, Callable[[Any, Any], bool]]] = {
    Keypoints: _same_keypoints,
    FallHorizon: _same_horizon,
    Wrench: _same_wrench,
    Odometry: _same_odometry,
}
