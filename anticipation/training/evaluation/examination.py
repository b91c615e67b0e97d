"""One checkpoint and what it had not seen: every clip becomes a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from torch import nn

from anticipation.centre import centre_velocity
from anticipation.checkpoint import Checkpoint
from anticipation.motion import WINDOW
from anticipation.predictor import Predictor
from anticipation.training.clips import Clip
from anticipation.training.evaluation.recordings import Recording
from anticipation.training.evaluation.records import Record, Ticks
from anticipation.training.evaluation.rivals import Rival
from anticipation.training.evaluation.stream import (
    Heard,
    centres,
    cleaned,
    hear,
    ticked_labels,
    whole,
    whole_windows,
)
from anticipation.training.fitting import apply
from anticipation.training.measures import STEPS as TABLE_STEPS
from bridge.config.anticipation import AnticipationConfig
from bridge.config.perception import CleaningConfig
from bridge.messages import STEPS, Keypoints
from perception.features import relative

SHIFTED: Final = "DGNN only, shifted labels"
NAIVE: Final = {"zero velocity": "zero_velocity", "constant velocity": "constant_velocity"}


def examine(
    checkpoint: Checkpoint,
    shifted: nn.Module | None,
    rivals: Sequence[Rival],
    recordings: Sequence[Recording],
    part: int,
) -> list[Record]:
    """Run clips of people who fall through the predictor as it runs live, and through the simpler ways.

    Without `shifted`, the paper's baseline, the naive forecasts are left out too.
    """
    predictor = Predictor(checkpoint, AnticipationConfig())
    judges = "DGNN" if checkpoint.outlook is None else "DGNN + outlook"
    naive = {
        f"{name} + {judges}": Predictor(checkpoint, AnticipationConfig.model_validate({"forecaster": forecaster}))
        for name, forecaster in (NAIVE.items() if shifted is not None else ())
    }
    return [
        Record(clip.name, clip.group, clip.source, kind, part, _ticks(clip, predictor, naive, shifted, rivals))
        for clip, kind in recordings
    ]


def _ticks(
    clip: Clip, predictor: Predictor, naive: Mapping[str, Predictor], shifted: nn.Module | None, rivals: Sequence[Rival]
) -> Ticks:
    ticks = cleaned(clip, CleaningConfig())
    there = np.array([whole(tick) for tick in ticks], dtype=np.bool_)
    poses = np.full((len(ticks), 12, 2), np.nan, dtype=np.float32)
    for at, tick in enumerate(ticks):
        if tick.body_length_px > 0:
            poses[at] = relative(tick.position_px, tick.body_length_px)
    tested = whole_windows(there)
    heard = hear(predictor, ticks)
    rows = {name: _classes(hear(each, ticks)) for name, each in naive.items()}
    centre_px = centres(ticks)
    windows = _windows(poses, centre_px, ticks, tested)
    if shifted is not None:
        rows[SHIFTED] = _shifted_classes(shifted, windows, tested)
    return Ticks(
        stamps_ns=np.array([tick.stamp_ns for tick in ticks], dtype=np.int64),
        labels=ticked_labels(clip, ticks),
        tested=tested,
        whole=there,
        poses=poses,
        centre_px=centre_px,
        body_px=np.array([tick.body_length_px for tick in ticks], dtype=np.float32),
        rows=rows,
        planes={rival.name: _spread(rival.judge(windows), tested) for rival in rivals},
        **heard._asdict(),
    )


def _windows(
    poses: NDArray[np.float32], centre_px: NDArray[np.float32], ticks: Sequence[Keypoints], tested: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return the whole windows (M, 15, 13, 2), one for each tick that ends one."""
    body_px = np.array([tick.body_length_px for tick in ticks])
    before = np.concatenate([np.full((1, 2), np.nan), centre_px[:-1]])[: len(ticks)]
    velocity = centre_velocity(centre_px.astype(np.float64), before, body_px).astype(np.float32)
    frames = np.concatenate([poses, velocity[:, None]], axis=1)
    ends = np.flatnonzero(tested)
    windows: NDArray[np.float32] = frames[ends[:, None] + np.arange(1 - WINDOW, 1)]
    return windows


def _classes(heard: Heard) -> NDArray[np.int8]:
    """Return the likeliest class (T, 16), -1 without a horizon."""
    likeliest = np.nan_to_num(heard.probabilities).argmax(axis=-1)
    return np.where(heard.valid[:, None], likeliest, -1).astype(np.int8)


def _shifted_classes(shifted: nn.Module, windows: NDArray[np.float32], tested: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Return what the paper's baseline says at the steps it has a head for, (T, 16), -1 elsewhere."""
    classes = np.full((len(tested), STEPS), -1, dtype=np.int8)
    if len(windows):
        said = apply(shifted, windows).argmax(axis=-1)  # (M, 6)
        classes[np.flatnonzero(tested)[:, None], list(TABLE_STEPS)] = said
    return classes


def _spread(values: NDArray[np.float32], tested: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return values of the tested ticks among all, NaN elsewhere."""
    everywhere = np.full((len(tested), *values.shape[1:]), np.nan, dtype=np.float32)
    everywhere[tested] = values
    return everywhere
