"""Cleaned clips cut into samples: half a second seen, half a second to come, sixteen labels.

The cleaning is `perception.cleaning`, the code that runs live.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anticipation.centre import centre_velocity
from anticipation.motion import HORIZON, ROWS, WINDOW
from anticipation.training.clips import UNLABELLED, Clip, Labels
from bridge.config.perception import CleaningConfig
from bridge.messages import KEYPOINTS, Floats, KeypointStatus
from perception.cleaning import clean_clip
from perception.features import relative, upper_body_centre

Flags = NDArray[np.bool_]
SPAN = WINDOW + HORIZON  # frames of a sample


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A clip as the live code cleans it, on the model's 30 Hz grid."""

    name: str
    group: str
    source: str
    frames: Floats  # (T, 13, 2) as `anticipation.motion` says; keypoints NaN where one is lost
    whole: Flags  # (T,) every keypoint measured or filled
    body_px: Floats  # (T,) body length [px]
    labels: Labels  # (T,)

    @property
    def poses(self) -> Floats:
        """Keypoints relative to the upper-body centre in body lengths, (T, 12, 2)."""
        return self.frames[:, :KEYPOINTS]


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Windows with what followed them. Where the future is unknown its frames repeat the last known one."""

    frames: NDArray[np.float32]  # (M, 30, 13, 2): WINDOW frames seen, HORIZON frames to come
    known: Flags  # (M, 30) the frame exists and is whole
    labels: Labels  # (M, 16) of the present and the next 15 frames
    body_px: NDArray[np.float32]  # (M,) body length at the present [px]
    track: NDArray[np.int64]  # (M,) index of the track

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def poses(self) -> NDArray[np.float32]:
        """Keypoints without the centre's velocity, (M, 30, 12, 2)."""
        return self.frames[:, :, :KEYPOINTS]

    def take(self, index: NDArray[np.int64]) -> Samples:
        """Return the samples at `index`."""
        return Samples(
            self.frames[index], self.known[index], self.labels[index], self.body_px[index], self.track[index]
        )


def clean(clip: Clip, config: CleaningConfig) -> Track:
    """Clean a clip and carry its labels to the 30 Hz grid: each frame takes the label nearest in time."""
    stamps = clip.stamps_ns()
    frames = clean_clip(clip.keypoints, stamps, config)
    positions = np.array([frame.position_px for frame in frames]).reshape(-1, 12, 2)
    body = np.array([frame.body_length_px for frame in frames], dtype=np.float64)
    lost = np.array([frame.status for frame in frames]).reshape(-1, 12) == KeypointStatus.LOST
    whole = ~lost.any(axis=1) & np.isfinite(positions).all(axis=(1, 2)) & (body > 0)
    centres = upper_body_centre(positions)
    before = np.concatenate([np.full((1, 2), np.nan), centres[:-1]])[: len(frames)]
    rows = np.full((len(frames), ROWS, 2), np.nan)
    rows[whole, :KEYPOINTS] = relative(positions[whole], body[whole])
    rows[:, KEYPOINTS] = centre_velocity(centres, before, body)
    labels = np.full(len(frames), UNLABELLED, dtype=np.int64)
    if clip.labels is not None and frames:
        labels = clip.labels[nearest(stamps, np.array([frame.stamp_ns for frame in frames]))]
    return Track(clip.name, clip.group, clip.source, rows, whole, body, labels)


def nearest(stamps: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each wanted time the index of the nearest stamp; `stamps` rise, the earlier wins a tie."""
    after = np.clip(np.searchsorted(stamps, wanted), 1, len(stamps) - 1) if len(stamps) > 1 else np.zeros_like(wanted)
    before = np.maximum(after - 1, 0)
    return np.where(wanted - stamps[before] <= stamps[after] - wanted, before, after)


def cut(tracks: Sequence[Track], stride: int = 1) -> Samples:
    """Cut every whole window of the tracks, one each `stride` frames."""
    rows, known, labels, body, owner = [], [], [], [], []
    for index, track in enumerate(tracks):
        frames = len(track.frames)
        for present in range(WINDOW - 1, frames, stride):
            first = present - WINDOW + 1
            if not track.whole[first : present + 1].all():
                continue
            stretch = np.arange(first, first + SPAN)
            exists = (stretch < frames) & track.whole[np.minimum(stretch, frames - 1)]
            last = np.maximum.accumulate(np.where(exists, np.arange(SPAN), 0))
            ahead = stretch[WINDOW - 1 :]
            rows.append(track.frames[first + last].astype(np.float32))
            known.append(exists)
            labels.append(np.where(ahead < frames, track.labels[np.minimum(ahead, frames - 1)], UNLABELLED))
            body.append(track.body_px[present])
            owner.append(index)
    return Samples(
        np.array(rows, dtype=np.float32).reshape(-1, SPAN, ROWS, 2),
        np.array(known, dtype=bool).reshape(-1, SPAN),
        np.array(labels, dtype=np.int64).reshape(-1, HORIZON + 1),
        np.array(body, dtype=np.float32),
        np.array(owner, dtype=np.int64),
    )


def join(parts: Sequence[Samples]) -> Samples:
    """Put samples of several origins together; track indices keep counting."""
    offsets = np.cumsum([0] + [int(part.track.max(initial=-1)) + 1 for part in parts[:-1]])
    return Samples(
        np.concatenate([part.frames for part in parts]),
        np.concatenate([part.known for part in parts]),
        np.concatenate([part.labels for part in parts]),
        np.concatenate([part.body_px for part in parts]),
        np.concatenate([part.track + offset for part, offset in zip(parts, offsets, strict=True)]),
    )
