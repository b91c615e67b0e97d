"""A clip through the predictor that runs live, tick by tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anticipation.motion import HORIZON, WINDOW
from anticipation.predictor import Predictor
from anticipation.training.clips import UNLABELLED, Clip, Labels
from anticipation.training.samples import nearest
from bridge.config.perception import CleaningConfig
from bridge.messages import KEYPOINTS, STEPS, Keypoints, KeypointStatus
from perception.cleaning import clean_clip
from perception.features import relative, upper_body_centre


class Heard(NamedTuple):
    """The horizon at each of T ticks; NaN and False where there was none."""

    valid: NDArray[np.bool_]  # (T,)
    quality: NDArray[np.float32]  # (T,)
    probabilities: NDArray[np.float32]  # (T, 16, 3)
    distance: NDArray[np.float32]  # (T, 16) [sd]
    plane: NDArray[np.float32]  # (T, 16, 2) [sd]
    forecast: NDArray[np.float16]  # (T, 15, 12, 2) relative to the foreseen upper-body centre [body lengths]


def cleaned(clip: Clip, config: CleaningConfig) -> list[Keypoints]:
    """Return the messages that perception would have sent of a clip of one person, one a tick."""
    return [
        Keypoints(
            stamp_ns=frame.stamp_ns,
            position_px=frame.position_px,
            confidence=frame.confidence,
            status=frame.status,
            body_length_px=frame.body_length_px,
            image_width=clip.width,
            image_height=clip.height,
        )
        for frame in clean_clip(clip.keypoints, clip.stamps_ns(), config)
    ]


def ticked_labels(clip: Clip, ticks: list[Keypoints]) -> Labels:
    """Return the label nearest in time to each tick, (T,)."""
    if clip.labels is None or not ticks:
        return np.full(len(ticks), UNLABELLED, dtype=np.int64)
    return clip.labels[nearest(clip.stamps_ns(), np.array([tick.stamp_ns for tick in ticks]))]


def whole_windows(whole: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for each tick (T,) whether it ends fifteen whole ones."""
    ends = np.zeros(len(whole), dtype=np.bool_)
    if len(whole) >= WINDOW:
        ends[WINDOW - 1 :] = np.lib.stride_tricks.sliding_window_view(whole, WINDOW).all(axis=1)
    return ends


def whole(tick: Keypoints) -> bool:
    """Tell whether every keypoint was measured or filled."""
    there = (tick.status != KeypointStatus.LOST).all() and np.isfinite(tick.position_px).all()
    return bool(there and tick.body_length_px > 0)


def hear(predictor: Predictor, ticks: list[Keypoints]) -> Heard:
    """Push every tick into a predictor that knows nothing of the person yet, and note each horizon."""
    count = len(ticks)
    heard = Heard(
        np.zeros(count, dtype=np.bool_),
        np.full(count, np.nan, dtype=np.float32),
        np.full((count, STEPS, 3), np.nan, dtype=np.float32),
        np.full((count, STEPS), np.nan, dtype=np.float32),
        np.full((count, STEPS, 2), np.nan, dtype=np.float32),
        np.full((count, HORIZON, KEYPOINTS, 2), np.nan, dtype=np.float16),
    )
    predictor.reset()
    for at, tick in enumerate(ticks):
        predictor.push(tick)
        horizon = predictor.predict()
        if horizon is None:
            continue
        heard.quality[at] = horizon.quality
        if not horizon.valid:
            continue
        heard.valid[at] = True
        heard.probabilities[at] = horizon.probabilities
        heard.distance[at] = horizon.distance
        heard.plane[at] = horizon.plane
        heard.forecast[at] = relative(horizon.forecast_px[1:], tick.body_length_px)
    return heard


def centres(ticks: list[Keypoints]) -> NDArray[np.float32]:
    """Return the upper-body centre at each tick, (T, 2) [px], NaN where unseen."""
    return np.array([upper_body_centre(tick.position_px) for tick in ticks], dtype=np.float32).reshape(-1, 2)
