"""Reading the clips to assess: `NAME/keypoints` and `NAME/fps` in `.npz` files."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bridge.errors import SourceError
from bridge.messages import KEYPOINTS, Floats

FPS_LIMITS = (5.0, 240.0)


class Clip(NamedTuple):
    """One recording of one person."""

    name: str
    path: Path
    keypoints: Floats  # (N, 12, 3): x [px], y [px], confidence; NaN = not found
    fps: float  # [Hz]


def read_clips(paths: Sequence[Path]) -> list[Clip]:
    """Return every clip of every file, all of them checked.

    Raises:
        SourceError: a file is missing or unreadable, has no clips, or a clip has a wrong shape,
            no keypoint at all, a frame rate out of range, or a name that another file has too.
    """
    clips: dict[str, Clip] = {}
    for path in paths:
        for clip in _read_file(path):
            if clip.name in clips:
                raise SourceError(f"{path}: clip '{clip.name}' is also in {clips[clip.name].path}")
            clips[clip.name] = clip
    return list(clips.values())


def _read_file(path: Path) -> Iterator[Clip]:
    if not path.is_file():
        raise SourceError(f"{path}: no such file")
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files if name.endswith(("/keypoints", "/fps"))}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise SourceError(f"{path}: not a readable .npz file: {error}") from error
    names = [name.removesuffix("/keypoints") for name in arrays if name.endswith("/keypoints")]
    if not names:
        raise SourceError(f"{path}: no array named NAME/keypoints")
    for name in names:
        yield _check(path, name, arrays)


def _check(path: Path, name: str, arrays: dict[str, np.ndarray]) -> Clip:
    keypoints = arrays[f"{name}/keypoints"]
    where = f"{path}: {name}/keypoints"
    if keypoints.ndim != 3 or keypoints.shape[1:] != (KEYPOINTS, 3) or not len(keypoints):
        raise SourceError(f"{where} has shape {keypoints.shape}, expected (N, {KEYPOINTS}, 3) with N >= 1")
    if keypoints.dtype.kind not in "fiu":
        raise SourceError(f"{where} has type {keypoints.dtype}, expected numbers")
    values = keypoints.astype(np.float64)
    if np.isinf(values).any():
        raise SourceError(f"{where} contains infinity; mark what was not found as NaN")
    if not np.isfinite(values).all(axis=2).any():
        raise SourceError(f"{where} holds no keypoint in any of its {len(values)} frames (all NaN)")
    if f"{name}/fps" not in arrays:
        raise SourceError(f"{path}: {name}/fps is missing")
    fps = np.asarray(arrays[f"{name}/fps"])
    if fps.size != 1 or fps.dtype.kind not in "fiu":
        raise SourceError(f"{path}: {name}/fps has shape {fps.shape}, expected one number")
    rate = float(fps.reshape(()))
    low, high = FPS_LIMITS
    if not low <= rate <= high:
        raise SourceError(f"{path}: {name}/fps is {rate:g}, limits {low:g}..{high:g}")
    return Clip(name, path, values, rate)
