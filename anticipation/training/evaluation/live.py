"""A clip through the whole system: perception, anticipation and the real intervention, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from anticipation.training.clips import UNLABELLED, Clip
from anticipation.training.evaluation.records import Frames
from bridge.assess.clips import read_clips
from bridge.assess.run import assess_clip
from bridge.config.surefoot import SurefootConfig


def watch(
    clips: Sequence[Clip], checkpoint: Path, config: SurefootConfig, done: Callable[[], None] = lambda: None
) -> list[Frames]:
    """Run clips through the nodes that run live, with the networks of `checkpoint`.

    It is what `surefoot assess` does, so that whatever perception, quality, thresholds and dwell make of a clip counts.
    The walker is healthy and unloaded: every intervention comes from what the camera saw.
    """
    anticipation = config.anticipation.model_copy(update={"checkpoint": str(checkpoint)})
    config = config.model_copy(update={"anticipation": anticipation})
    with TemporaryDirectory() as folder:
        path = Path(folder) / "clips.npz"
        arrays = {}
        for index, clip in enumerate(clips):
            arrays[f"clip-{index:04d}/keypoints"] = clip.keypoints
            arrays[f"clip-{index:04d}/fps"] = np.array(clip.fps)
            arrays[f"clip-{index:04d}/image_size"] = np.array([clip.width, clip.height])
        np.savez(path, allow_pickle=False, **arrays)
        written = {each.name: each for each in read_clips([path], config.perception.source)} if clips else {}
        frames = []
        for index, clip in enumerate(clips):
            seen = assess_clip(written[f"clip-{index:04d}"], config)
            labels = np.full(len(clip.keypoints), UNLABELLED) if clip.labels is None else clip.labels
            frames.append(
                Frames(
                    clip.stamps_ns(),
                    labels.astype(np.int64),
                    seen.state,
                    seen.stiffening.astype(np.float32),
                    seen.quality.astype(np.float32),
                    seen.probabilities.astype(np.float32),
                    seen.distance.astype(np.float32),
                )
            )
            done()
        return frames
