"""From the people a detector found in each frame to one `Keypoints` message for every 30 Hz tick."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bridge.config.perception import PerceptionConfig
from bridge.messages import Floats, Keypoints, KeypointStatus
from perception.cleaning import Cleaner, CleanFrame
from perception.skeleton import L_HIP, L_SHOULDER, R_HIP, R_SHOULDER
from perception.tracking import Tracker

_REACH = 5.0  # image sizes; a detection further out is none


class PerceptionPipeline:
    """Follows one person, cleans their keypoints and says what is wrong with them."""

    def __init__(self, config: PerceptionConfig, frame_id: str = "camera") -> None:
        self._config = config
        self._frame_id = frame_id
        self._tracker = Tracker(config.tracking)
        self._cleaner = Cleaner(config.cleaning)

    def push(self, people: Sequence[Floats], stamp_ns: int, image_size: tuple[int, int]) -> list[Keypoints]:
        """Take in one frame and return the messages of the ticks it completes, often one.

        Args:
            people: one (12, 3) array for each person found: x, y [px], confidence; NaN where not found.
            stamp_ns: exposure of the frame [ns].
            image_size: width and height [px].
        """
        reach = _REACH * max(image_size)
        usable = [self._usable(person, reach) for person in people]
        found = [person for person in usable if self._is_person(person)]
        sight = self._tracker.push(found, stamp_ns, self._cleaner.body_length_px)
        if sight.relocked:
            self._cleaner.forget_person()
        person = np.full((12, 3), np.nan) if sight.person is None else sight.person
        ticks = self._cleaner.push(person, stamp_ns)
        return [self._message(tick, len(found), image_size) for tick in ticks]

    def _usable(self, person: Floats, reach: float) -> Floats:
        """Copy of (12, 3) with NaN in every row that cannot be used."""
        person = np.array(person, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            usable = (np.abs(person[:, :2]) <= reach).all(axis=1)
            usable &= person[:, 2] >= self._config.cleaning.min_confidence
        person[~usable] = np.nan
        return person

    def _is_person(self, person: Floats) -> bool:
        return int(np.count_nonzero(~np.isnan(person[:, 0]))) >= self._config.tracking.min_keypoints

    def _message(self, tick: CleanFrame, people: int, image_size: tuple[int, int]) -> Keypoints:
        reason = self._fault(tick)
        return Keypoints(
            stamp_ns=tick.stamp_ns,
            position_px=tick.position_px,
            confidence=tick.confidence,
            status=tick.status,
            body_length_px=tick.body_length_px,
            image_width=image_size[0],
            image_height=image_size[1],
            valid=not reason,
            reason=reason,
            people=people,
            frame_id=self._frame_id,
        )

    def _fault(self, tick: CleanFrame) -> str:
        """Why the tick must not be used; '' if it may."""
        if not self._tracker.locked:
            return "nobody in view"
        kept = tick.status != KeypointStatus.LOST
        shoulders = kept[L_SHOULDER] or kept[R_SHOULDER]
        hips = kept[L_HIP] or kept[R_HIP]
        if not kept.any():
            unseen_s = self._tracker.unseen_s(tick.stamp_ns)
            return f"followed person lost for {max(unseen_s, 0.0):.1f} s"
        if not (shoulders and hips):
            return f"{'hips' if shoulders else 'shoulders'} of the followed person lost"
        if not math.isfinite(tick.body_length_px):
            return "body length not known yet"
        return ""
