"""Which of the people in view is followed: the one locked at start, until lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.config.perception import TrackingConfig
from bridge.messages import Floats

_MIN_COMMON = 3  # keypoints; with fewer in common two sights are compared by their middles


class Sight(NamedTuple):
    """What the tracker made of one frame."""

    person: Floats | None  # (12, 3) the followed person, None if not in view
    relocked: bool  # somebody new is followed from this frame on


class Tracker:
    """Follows one person by the nearest detection within a gate.

    The gate is `gate_body_lengths`, wider by `gate_speed_body_lengths_s` for the
    time without a sight, up to `gate_most_body_lengths`. Somebody outside the gate
    is somebody else, and followed only after `relock_s` without the followed person.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._last: Floats | None = None  # (12, 2), NaN where not seen
        self._seen_ns = 0

    @property
    def locked(self) -> bool:
        """Whether somebody is followed."""
        return self._last is not None

    def unseen_s(self, now_ns: int) -> float:
        """Time since the followed person was last seen [s]; inf if nobody is followed."""
        return (now_ns - self._seen_ns) / NS if self.locked else math.inf

    def push(self, people: Sequence[Floats], stamp_ns: int, body_length_px: float) -> Sight:
        """Pick the followed person among `people`.

        Args:
            people: (12, 3) each, NaN where not usable; all of them large enough to be persons.
            stamp_ns: time of the frame [ns].
            body_length_px: of the followed person [px]; NaN if not known yet.
        """
        chosen = self._nearest(people, stamp_ns, body_length_px)
        relocked = False
        if chosen is None and people and self.unseen_s(stamp_ns) > self._config.relock_s:
            chosen = max(people, key=_prominence)
            relocked = True
        if chosen is not None:
            seen = chosen[:, :2]
            known = seen if self._last is None or relocked else np.where(np.isnan(seen), self._last, seen)
            self._last, self._seen_ns = known, stamp_ns
        return Sight(chosen, relocked)

    def _nearest(self, people: Sequence[Floats], stamp_ns: int, body_length_px: float) -> Floats | None:
        if self._last is None or not people:
            return None
        last = self._last
        size_px = body_length_px if math.isfinite(body_length_px) else _extent(last)
        widened = self._config.gate_body_lengths + self._config.gate_speed_body_lengths_s * self.unseen_s(stamp_ns)
        distances = [_distance(person[:, :2], last) for person in people]
        nearest = int(np.argmin(distances))
        gate = max(self._config.gate_body_lengths, min(widened, self._config.gate_most_body_lengths))
        return people[nearest] if distances[nearest] <= gate * size_px else None


def _distance(one: Floats, other: Floats) -> float:
    """Mean distance of the keypoints two sights (12, 2) have in common [px]."""
    distance = np.hypot(one[:, 0] - other[:, 0], one[:, 1] - other[:, 1])
    common = ~np.isnan(distance)
    if np.count_nonzero(common) >= _MIN_COMMON:
        return float(distance[common].mean())
    return math.dist(np.nanmean(one, axis=0), np.nanmean(other, axis=0))


def _extent(position_px: Floats) -> float:
    """Diagonal of the bounding box of (12, 2) [px]."""
    width, height = np.nanmax(position_px, axis=0) - np.nanmin(position_px, axis=0)
    return math.hypot(width, height)


def _prominence(person: Floats) -> float:
    """Large and surely seen: extent times mean confidence of (12, 3)."""
    return _extent(person[:, :2]) * float(np.nanmean(person[:, 2]))
