"""Streaming cleaning of one person's keypoints: detections at any rate in, clean keypoints at 30 Hz out.

The steps follow Cho et al., "Anticipatory Fall Detection in Humans with Hybrid
Directed Graph Neural Networks and Long Short-Term Memory", section II.B: a missing
keypoint continues the line through its previous two points; a keypoint that moves
faster than people can is treated as missing; a second-order Butterworth low-pass
takes out the detector's noise. Here everything is causal, extrapolation is bounded
in time, and speeds are in body lengths per second, so that no threshold depends on
the resolution.

    detection -> confidence -> outliers -> line (bounded) -> 30 Hz grid -> Butterworth -> CleanFrame
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS, nanoseconds
from bridge.config.perception import CleaningConfig
from bridge.messages import KEYPOINTS, Bytes, Floats, KeypointStatus
from perception.features import BodyScale

RATE_HZ: Final = 30.0
"""The clock of the networks."""

PERIOD_NS: Final = round(NS / RATE_HZ)

_LONG_S = 1e6
_SLACK_S = 1e-3  # a bound of a whole number of frames does not hang on the rounding of stamps

_PHASE_GAIN = 0.1  # share of a frame's distance from its tick by which the grid follows the camera

_MEASURED = np.uint8(KeypointStatus.MEASURED)  # as the arrays hold them: looking up an enum's member is slow
_FILLED = np.uint8(KeypointStatus.FILLED)
_LOST = np.uint8(KeypointStatus.LOST)

Mask = NDArray[np.bool_]


class CleanFrame(NamedTuple):
    """One tick of the 30 Hz clock.

    Two ticks are further apart than 1.5 periods only where the source had a gap
    longer than `fill_s`; whoever keeps a window of ticks starts it anew there.
    """

    stamp_ns: int  # the tick; never later than the newest frame it rests on [ns]
    position_px: Floats  # (12, 2), NaN where LOST [px]
    confidence: Floats  # (12,), the detector's, 0..1; 0 where nothing was measured
    status: Bytes  # (12,), KeypointStatus
    body_length_px: float  # NaN until trunk or legs were seen once [px]


class _Points(NamedTuple):
    """All keypoints at the time of one camera frame."""

    stamp_ns: int
    position_px: Floats  # (12, 2), NaN where LOST
    confidence: Floats  # (12,)
    status: Bytes  # (12,)
    restarted: Mask  # (12,) nothing joins this point to the one in the frame before


class Cleaner:
    """Cleans one person's keypoints frame by frame."""

    def __init__(self, config: CleaningConfig) -> None:
        self._config = config
        self._scale = BodyScale(config.scale)
        self._lines = _Lines(config)
        self._grid = _Grid(nanoseconds(config.snap_s))
        self._filter = _Butterworth(config.cutoff_hz)
        self._origin_ns = 0
        self._newest_ns: int | None = None

    def push(self, keypoints: Floats, stamp_ns: int) -> list[CleanFrame]:
        """Take in one camera frame and return the ticks of the grid that it completes, often one.

        A frame that is not newer than the last one is ignored.

        Args:
            keypoints: (12, 3) x, y [px], confidence; NaN where not found.
            stamp_ns: exposure of the frame [ns].

        Raises:
            ValueError: `keypoints` has another shape.
        """
        if keypoints.shape != (KEYPOINTS, 3):
            raise ValueError(f"keypoints have shape {keypoints.shape}, expected ({KEYPOINTS}, 3)")
        if self._newest_ns is None:
            self._origin_ns = stamp_ns
        else:
            step_ns = stamp_ns - self._newest_ns
            if step_ns <= 0:
                return []
            if step_ns > (self._config.fill_s + _SLACK_S) * NS:
                self._restart()
        self._newest_ns = stamp_ns
        now_s = (stamp_ns - self._origin_ns) / NS
        points = self._lines.push(np.asarray(keypoints, dtype=np.float64), stamp_ns, now_s, self._scale.length_px)
        measured = np.where((points.status == _MEASURED)[:, None], points.position_px, np.nan)
        body_length = self._scale.update(measured, now_s)
        return [
            CleanFrame(
                tick.stamp_ns,
                self._filter.push(tick.position_px, tick.restarted),
                tick.confidence,
                tick.status,
                body_length,
            )
            for tick in self._grid.push(points)
        ]

    @property
    def body_length_px(self) -> float:
        """Body length after the newest frame [px]; NaN until trunk or legs were seen once."""
        return self._scale.length_px

    def forget_person(self) -> None:
        """Begin anew with somebody else, on the same grid of ticks."""
        self._lines = _Lines(self._config)
        self._scale.reset()

    def _restart(self) -> None:
        """Forget all motion, but not the person's size."""
        self._lines = _Lines(self._config)
        self._grid = _Grid(nanoseconds(self._config.snap_s))
        self._filter = _Butterworth(self._config.cutoff_hz)


def clean_clip(keypoints: Floats, stamps_ns: Iterable[int], config: CleaningConfig) -> list[CleanFrame]:
    """Clean a whole clip with the numbers of the streaming use.

    Args:
        keypoints: (N, 12, 3) x, y [px], confidence; NaN where not found.
        stamps_ns: (N,) exposure of each frame, rising [ns].
        config: the same section as the live path's.
    """
    cleaner = Cleaner(config)
    ticks: list[CleanFrame] = []
    for frame, stamp_ns in zip(keypoints, stamps_ns, strict=True):
        ticks.extend(cleaner.push(frame, int(stamp_ns)))
    return ticks


class _Lines:
    """Accepts, rejects and continues each keypoint's path.

    A point is *alive* for `fill_s` after its last accepted detection. While alive,
    a detection is accepted if it lies within reach of the last accepted one, that
    is within `max_speed * body length * time since`. A point that is not alive
    starts anew at whatever is detected next, so nothing can be rejected for longer
    than `fill_s`.
    """

    def __init__(self, config: CleaningConfig) -> None:
        self._config = config
        self._last = np.full((KEYPOINTS, 2), np.nan)  # last accepted position [px]
        self._last_s = np.full(KEYPOINTS, -np.inf)  # and its time [s]
        self._velocity = np.zeros((KEYPOINTS, 2))  # slope of the line through the last two accepted [px/s]
        self._rejected = np.full((KEYPOINTS, 2), np.nan)  # last detection out of reach since then [px]

    def push(self, keypoints: Floats, stamp_ns: int, now_s: float, body_length_px: float) -> _Points:
        position = keypoints[:, :2]
        confidence = keypoints[:, 2]
        detected = (confidence >= self._config.min_confidence) & np.isfinite(keypoints).all(axis=1)

        elapsed_s = now_s - self._last_s
        alive = elapsed_s <= self._config.fill_s + _SLACK_S
        step = position - self._last
        distance = np.hypot(step[:, 0], step[:, 1])
        reach = self._config.max_speed_body_lengths_s * body_length_px * elapsed_s
        out_of_reach = detected & alive & (distance > reach)  # never while the body length is NaN
        accepted = detected & ~out_of_reach
        # Within reach by now, but nearer to where it was rejected than to the old line: it has moved there.
        moved = position - self._rejected
        moved_away = np.hypot(moved[:, 0], moved[:, 1]) < distance
        restarted = accepted & (~alive | moved_away)

        joined = (accepted & ~restarted)[:, None]
        span_s = np.minimum(elapsed_s, _LONG_S)[:, None]  # finite also on points that were never seen
        continued = self._last + self._velocity * span_s
        self._velocity = np.where(joined, step / span_s, self._velocity)
        self._velocity[restarted] = 0.0
        self._last = np.where(accepted[:, None], position, self._last)
        self._last_s = np.where(accepted, now_s, self._last_s)
        self._rejected = np.where(out_of_reach[:, None], position, self._rejected)
        self._rejected[accepted] = np.nan

        filled = alive & ~accepted
        kept = accepted | filled
        status = np.where(accepted, _MEASURED, _FILLED)
        status[~kept] = _LOST
        path = np.where(accepted[:, None], position, continued)
        path[~kept] = np.nan
        measured_confidence = np.where(accepted, np.minimum(confidence, 1.0), 0.0)
        return _Points(stamp_ns, path, measured_confidence, status, restarted)


class _Grid:
    """Resamples onto the 30 Hz grid, using nothing later than the newest frame.

    A frame within `snap_ns` of a tick is that tick, unchanged, and pulls the phase
    of the grid a little towards itself: a 30 fps camera gives one tick for each
    frame, whatever its jitter. Other ticks lie on the straight line between the
    frames around them.
    """

    def __init__(self, snap_ns: int) -> None:
        self._snap_ns = snap_ns
        self._next_ns = 0
        self._before: _Points | None = None
        self._pending = np.ones(KEYPOINTS, dtype=np.bool_)  # restarts that no tick has shown yet

    def push(self, points: _Points) -> list[_Points]:
        if self._before is None:
            self._next_ns = points.stamp_ns
        self._pending |= points.restarted
        ticks = []
        while self._next_ns <= points.stamp_ns + self._snap_ns:
            late_ns = points.stamp_ns - self._next_ns
            if late_ns <= self._snap_ns or self._before is None:
                tick = points
                self._next_ns += PERIOD_NS + round(_PHASE_GAIN * late_ns)
            else:
                tick = _between(self._before, points, self._next_ns)
                self._next_ns += PERIOD_NS
            lost = tick.status == _LOST
            ticks.append(tick._replace(restarted=self._pending & ~lost))
            self._pending = lost
        self._before = points
        return ticks


def _between(before: _Points, after: _Points, stamp_ns: int) -> _Points:
    """Points on the straight line between two frames; lost where a point was lost or restarted."""
    weight = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    position = before.position_px + weight * (after.position_px - before.position_px)
    position[after.restarted] = np.nan
    status = np.maximum(before.status, after.status)
    status[after.restarted] = _LOST
    confidence = np.where(
        status == _MEASURED,
        before.confidence + weight * (after.confidence - before.confidence),
        0.0,
    )
    return _Points(stamp_ns, position, confidence, status, after.restarted)


class _Butterworth:
    """Second-order low-pass by the bilinear transform, one state per coordinate.

    `H(s) = 1 / (s^2 + sqrt(2) s + 1)` with the cut-off frequency prewarped, in
    transposed direct form II (Oppenheim and Schafer, "Discrete-Time Signal
    Processing", sections 6.3 and 7.2). A restarted point begins in the steady state
    of its position, so that there is no transient.
    """

    def __init__(self, cutoff_hz: float) -> None:
        k = math.tan(math.pi * cutoff_hz / RATE_HZ)
        norm = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
        self._b0 = k * k * norm
        self._b1 = 2.0 * self._b0
        self._b2 = self._b0
        self._a1 = 2.0 * (k * k - 1.0) * norm
        self._a2 = (1.0 - math.sqrt(2.0) * k + k * k) * norm
        self._z1 = np.zeros((KEYPOINTS, 2))
        self._z2 = np.zeros((KEYPOINTS, 2))

    def push(self, position_px: Floats, restarted: Mask) -> Floats:
        x = position_px
        start = restarted[:, None]
        z1 = np.where(start, (1.0 - self._b0) * x, self._z1)
        z2 = np.where(start, (self._b2 - self._a2) * x, self._z2)
        y = self._b0 * x + z1
        self._z1 = self._b1 * x - self._a1 * y + z2
        self._z2 = self._b2 * x - self._a2 * y
        return y
