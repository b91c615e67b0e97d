"""Optical motion capture seen through virtual cameras: normal motion of people who do not fall.

CMU (subjects 1 to 7) and Bandai Namco Research. LaFAN1 is left out: its licence allows no derivatives, and the
other two hold walking enough.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from anticipation.training.cameras import draw_camera
from anticipation.training.clips import STABLE, Clip, load_arrays, required
from anticipation.training.detector import observe
from bridge.messages import Floats

FPS: Final = 30.0
SHORTEST: Final = 45  # frames: a window, a horizon and as much again to settle the filters
LONGEST: Final = 150  # frames taken of one clip under one camera
LICENCES: Final = {"cmu": "free for all uses", "bandai_namco": "CC BY-NC 4.0"}
ANKLE_M: Final = 0.10  # of a foot on the floor
WALKS: Final = ("walk", "run", "dash")


def read(folder: Path, clips: int, seed: int) -> list[Clip]:
    """Draw `clips` clips, each seen by a camera of its own; a third CMU, the rest Bandai Namco, most of them gait.

    Raises:
        SourceError: a file is missing or damaged.
    """
    rng = np.random.default_rng(seed)
    motions = {name: load_arrays(required(folder, f"mocap/{name}.npz")) for name in LICENCES}
    gait = sorted(name for name in motions["bandai_namco"] if name.split("_")[1].startswith(WALKS))
    other = sorted(set(motions["bandai_namco"]) - set(gait))
    drawn = []
    for index in range(clips):
        kind = rng.random()
        data, pool = (
            ("cmu", sorted(motions["cmu"])) if kind < 1 / 3 else ("bandai_namco", gait if kind < 0.8 else other)
        )
        name = pool[int(rng.integers(len(pool)))]
        drawn.append(_seen(name, data, motions[data][name], index, rng))
    return [clip for clip in drawn if len(clip.keypoints) >= SHORTEST]


def on_floor(points: Floats) -> Floats:
    """Return points (T, 12, 3) [m] of a motion that has its lowest ankle where ankles are: CMU's origin is the pelvis.

    The lowest keypoint of a frame in fifty decides, so that neither a jump nor a slip of the suit does.
    """
    shifted = points.copy()
    shifted[..., 2] += ANKLE_M - np.percentile(points[..., 2].min(axis=1), 2.0)
    return shifted


def _seen(name: str, data: str, points: Floats, index: int, rng: np.random.Generator) -> Clip:
    """Cut a stretch of the motion and look at it through a random camera."""
    start = int(rng.integers(max(1, len(points) - LONGEST)))
    camera = draw_camera(rng)
    keypoints = observe(camera.project(on_floor(points)[start : start + LONGEST]), rng)
    labels = np.full(len(keypoints), STABLE, dtype=np.int64)
    group = f"{data}/{name}"
    return Clip(
        f"{name}/camera-{index}", group, keypoints, FPS, labels, camera.width, camera.image_height, data, LICENCES[data]
    )
