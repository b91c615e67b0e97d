"""Recordings of a kinematic person as keypoint files, and the one that ships for the demo."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulation.kinematic.body import Floats
from simulation.kinematic.camera import Camera
from simulation.kinematic.detector import Detector
from simulation.kinematic.events import Event, Stumble
from simulation.kinematic.fall import Fall
from simulation.kinematic.motion import Walker, move

DEMO: Final = "walk-stumble-fall"
DEMO_DURATION_S: Final = 14.0
DEMO_EVENTS: Final[tuple[Event, ...]] = (Stumble(at_s=6.0), Fall(at_s=10.5, direction_rad=np.radians(70.0)))
DEMO_CAMERA: Final = Camera(position_m=(2.1, -2.4, 1.3), look_at_m=(0.0, 0.0, 0.75))

_ZIP_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can say: the file depends on its content alone


class Recording(NamedTuple):
    """What a camera and an estimator report of a person."""

    keypoints: Floats  # (N, 12, 3) x, y [px], confidence; NaN and 0 where not found
    exact: Floats  # (N, 12, 3) without the estimator's errors: x, y [px], depth [m]
    label: NDArray[np.int8]  # (N,) -1 stable, 0 falling, 1 lying
    fps: float
    image_size: tuple[int, int]  # width, height [px]


def record(
    walker: Walker,
    events: Sequence[Event],
    duration_s: float,
    camera: Camera,
    detector: Detector,
    fps: float,
    seed: int,
) -> Recording:
    """Return what `camera` and `detector` report of the motion; the motion depends on the seed, not on `fps`."""
    moving, detecting = np.random.default_rng(seed).spawn(2)
    motion = move(walker, events, duration_s, moving)
    frames_s = np.arange(int(duration_s * fps)) / fps
    nearest = np.rint(frames_s / (motion.time_s[1] - motion.time_s[0])).astype(np.int64)
    seen = camera.project(motion.keypoints_m, camera.anchor(motion.hips_m[:, :2]))[nearest]
    label = motion.label[nearest].astype(np.int8)
    return Recording(detector.observe(seen, fps, detecting), seen, label, fps, (camera.width_px, camera.height_px))


def demo(seed: int = 0) -> Recording:
    """Return the recording of the demo: a walk, a survived stumble, walking on, a fall."""
    return record(Walker(), DEMO_EVENTS, DEMO_DURATION_S, DEMO_CAMERA, Detector(), 30.0, seed)


def save(recordings: Mapping[str, Recording], path: Path) -> None:
    """Write a keypoint file, whole or not at all; the same recordings give the same bytes.

    Arrays: `NAME/keypoints` (N, 12, 3) rounded to 0.01 px, `NAME/fps`, `NAME/image_size` (2,), `NAME/label` (N,).
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, recording in recordings.items():
            arrays: dict[str, NDArray[Any]] = {
                "keypoints": np.round(recording.keypoints, 2).astype(np.float32),
                "fps": np.float64(recording.fps) * np.ones(()),
                "image_size": np.array(recording.image_size, dtype=np.int64),
                "label": recording.label,
            }
            for key, array in arrays.items():
                buffer = io.BytesIO()
                np.lib.format.write_array(buffer, array)
                archive.writestr(zipfile.ZipInfo(f"{name}/{key}.npy", _ZIP_EPOCH), buffer.getvalue())
    part.replace(path)
