"""The last half second of one person, tick by tick, as the networks want it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anticipation.centre import centre_velocity
from anticipation.motion import ROWS, WINDOW
from bridge.clock import nanoseconds
from bridge.config.anticipation import AnticipationConfig
from bridge.messages import KEYPOINTS, STEP_S, Bytes, Floats, Keypoints, KeypointStatus
from perception.features import relative, upper_body_centre

_PERIOD_NS = nanoseconds(STEP_S)


class PoseWindow:
    """Fifteen ticks of relative coordinates and of the centre's velocity, newest last.

    A lost keypoint is held at its last place relative to the body for `hold_s`, then put at its average place.
    Ticks that are missing, not valid or without a body centre are filled on the line between
    their neighbours when the next good one arrives, if they last no longer than `max_gap_s`;
    after a longer gap the window starts anew.
    """

    def __init__(self, config: AnticipationConfig, mean_pose: Floats) -> None:
        self._hold_ns = nanoseconds(config.hold_s)
        self._longest_gap = round(config.max_gap_s / STEP_S)  # ticks
        self._min_keypoints = config.min_keypoints
        self._min_body_length_px = config.min_body_length_px
        self._mean_pose = mean_pose
        self.rows: NDArray[np.float32] = np.zeros((WINDOW, ROWS, 2), dtype=np.float32)  # what the networks read
        self.relative = self.rows[:, :KEYPOINTS]  # [body lengths]
        self.status: Bytes = np.zeros((WINDOW, KEYPOINTS), dtype=np.uint8)  # KeypointStatus
        self.centre_px: Floats = np.zeros((WINDOW, 2))
        self.reset()

    def reset(self) -> None:
        """Forget the person."""
        self.frames = 0  # good ticks in the window, at most 15
        self.stamp_ns = -1  # of the newest message
        self.refusal = ""  # why the newest message cannot be used, in words
        self.body_length_px = np.nan
        self.people = 0
        self._last_good_ns = 0
        self._held = np.array(self._mean_pose)  # (12, 2) last place seen
        self._seen_ns = np.full(KEYPOINTS, np.iinfo(np.int64).min // 2)

    @property
    def full(self) -> bool:
        """Whether all fifteen ticks are there."""
        return self.frames == WINDOW

    def push(self, keypoints: Keypoints) -> None:
        """Take in the next tick; one that is not newer than the last is ignored."""
        if keypoints.stamp_ns <= self.stamp_ns:
            return
        self.stamp_ns = keypoints.stamp_ns
        self.people = keypoints.people
        centre = upper_body_centre(keypoints.position_px)
        self.refusal = self._judge(keypoints, centre)
        if self.refusal:
            if self._ticks_since_good() > self._longest_gap:
                self.frames = 0
            return
        self._join(keypoints, centre)
        self._last_good_ns = keypoints.stamp_ns
        self.body_length_px = keypoints.body_length_px

    def _judge(self, keypoints: Keypoints, centre: Floats) -> str:
        if not keypoints.valid:
            return f"keypoints are not valid: {keypoints.reason or 'no reason given'}"
        if not keypoints.body_length_px >= self._min_body_length_px:  # nor NaN
            return f"body length is {keypoints.body_length_px:.1f} px, limit {self._min_body_length_px:.1f}"
        seen = int(np.count_nonzero(keypoints.status != KeypointStatus.LOST))
        if seen < self._min_keypoints:
            return f"{seen} of {KEYPOINTS} keypoints are there, limit {self._min_keypoints}"
        if not np.isfinite(centre).all():
            return "the upper-body centre is not known: both shoulders or both hips are lost"
        return ""

    def _join(self, keypoints: Keypoints, centre: Floats) -> None:
        """Append a good tick and what is missing before it."""
        missing = self._ticks_since_good() - 1
        if missing > self._longest_gap:
            self.frames = 0
        if self.frames == 0:
            missing = 0
        pose = self._complete(keypoints)
        status = np.where(np.isfinite(keypoints.position_px).all(axis=1), keypoints.status, KeypointStatus.LOST)
        before, centre_before = self.relative[-1].copy(), self.centre_px[-1].copy()
        if self.frames == 0:
            centre_before = np.full(2, np.nan)  # whoever was there before is no place to come from
        velocity = centre_velocity(centre, centre_before, keypoints.body_length_px, missing + 1)
        self._shift(missing + 1)
        self.rows[-missing - 1 :, KEYPOINTS] = velocity
        for tick in range(1, missing + 1):
            share = tick / (missing + 1)
            row = tick - missing - 2
            self.relative[row] = before + share * (pose - before)
            self.centre_px[row] = centre_before + share * (centre - centre_before)
            self.status[row] = np.maximum(status, KeypointStatus.FILLED)
        self.relative[-1], self.centre_px[-1], self.status[-1] = pose, centre, status

    def _complete(self, keypoints: Keypoints) -> Floats:
        """Relative coordinates (12, 2) with lost points held, or at their average place."""
        pose = relative(keypoints.position_px, keypoints.body_length_px)
        there = np.isfinite(pose).all(axis=1)
        remembered = keypoints.stamp_ns - self._seen_ns <= self._hold_ns
        pose = np.where(there[:, None], pose, np.where(remembered[:, None], self._held, self._mean_pose))
        self._held[there] = pose[there]
        self._seen_ns[there] = keypoints.stamp_ns
        return pose

    def _shift(self, ticks: int) -> None:
        for rows in (self.rows, self.centre_px, self.status):
            rows[:-ticks] = rows[ticks:].copy()
        self.frames = min(WINDOW, self.frames + ticks)

    def _ticks_since_good(self) -> int:
        return max(1, round((self.stamp_ns - self._last_good_ns) / _PERIOD_NS))
