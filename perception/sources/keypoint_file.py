"""Keypoint clips in `.npz` files.

A clip NAME is an array `NAME/keypoints`, or `NAME/<detector>`, or plain `NAME`, of
shape (N, 12, 3): x, y [px], confidence; NaN where not found. Beside it may lie
`NAME/fps` (scalar) and `NAME/image_size` (width, height).
"""

from __future__ import annotations

import difflib
import math
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.perception import SourceConfig
from bridge.errors import SourceError
from bridge.messages import KEYPOINTS, Floats
from perception.sources.playback import Still

_PREFERRED = ("keypoints", "alphapose", "movenet")  # where the clip has several and none is named
_BESIDE = ("fps", "image_size", "label", "held")
_MAX_FPS_HZ = 240.0
_DAMAGE = (OSError, ValueError, EOFError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error)


class Clip(NamedTuple):
    """One person's keypoints over time."""

    name: str
    keypoints: Floats  # (N, 12, 3) x, y [px], confidence; NaN where not found
    fps_hz: float
    width: int  # of the image [px]
    height: int  # of the image [px]

    @property
    def stamps_ns(self) -> list[int]:
        """Time of each frame since the first [ns]."""
        return [round(k * NS / self.fps_hz) for k in range(len(self.keypoints))]


def clip_names(path: Path) -> list[str]:
    """Return the names of the clips in `path`, such as 'fall-01/alphapose' or 'walk'.

    An array called NAME/keypoints is the clip NAME, and what lies beside it is no clip.

    Raises:
        SourceError: no such file, or not a readable npz.
    """
    with _open(path) as arrays:
        return _clip_names(arrays)


def read_clip(path: Path, name: str, config: SourceConfig) -> Clip:
    """Read one clip; with an empty `name`, the only one.

    Args:
        path: the npz file.
        name: 'NAME', or 'NAME/ARRAY' to choose among several detectors' arrays.
        config: frame rate and image size where the file has none.

    Raises:
        SourceError: says what is missing, damaged or of the wrong shape.
    """
    with _open(path) as arrays:
        key = _find(path, arrays, name)
        base = key.rpartition("/")[0] or key
        keypoints = _keypoints(path, key, _read(path, arrays, key))
        fps_hz = config.fps_hz
        if f"{base}/fps" in arrays:
            fps_hz = _fps(path, f"{base}/fps", _read(path, arrays, f"{base}/fps"))
        size = (config.image_width_px, config.image_height_px)
        if f"{base}/image_size" in arrays:
            size = _image_size(path, f"{base}/image_size", _read(path, arrays, f"{base}/image_size"))
    return Clip(name or base, keypoints, fps_hz, *size)


def stills(clip: Clip) -> Iterator[Still]:
    """Give the frames of `clip` one by one."""
    for offset_ns, person in zip(clip.stamps_ns, clip.keypoints, strict=True):
        found = bool(np.isfinite(person[:, 0]).any())
        yield Still(offset_ns, clip.width, clip.height, None, (person,) if found else ())


@contextmanager
def _open(path: Path) -> Iterator[Any]:
    if not path.is_file():
        raise SourceError(f"{path}: no such keypoint file")
    try:
        opened = path.open("rb")
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from error
    with opened as file:
        try:
            arrays = np.load(file, allow_pickle=False)
        except _DAMAGE as error:
            raise SourceError(f"{path}: not a readable npz file ({_one_line(error)})") from error
        if not isinstance(arrays, np.lib.npyio.NpzFile):
            raise SourceError(f"{path}: a single array, expected an npz file of clips")
        with arrays:
            yield arrays


def _read(path: Path, arrays: Any, key: str) -> NDArray[Any]:
    try:
        array: NDArray[Any] = arrays[key]
    except _DAMAGE as error:
        raise SourceError(f"{path}: array '{key}' is damaged ({_one_line(error)})") from error
    return array


def _one_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


def _clip_names(arrays: Any) -> list[str]:
    whole = {key.removesuffix("/keypoints") for key in arrays.files if key.endswith("/keypoints")}
    names = []
    for key in arrays.files:
        base, _, last = key.rpartition("/")
        if last == "keypoints" and base:
            names.append(base)
        elif base not in whole and last not in _BESIDE:
            names.append(key)
    return names


def _find(path: Path, arrays: Any, name: str) -> str:
    """Return the key of the array that `name` means."""
    keys: list[str] = list(arrays.files)
    names = _clip_names(arrays)
    if not name:
        if len(names) == 1:
            return _find(path, arrays, names[0])
        some = ", ".join(names[:3])
        raise SourceError(
            f"{path}: holds {len(names)} clips, name one as {path.name}:CLIP ({some}{', ...' if names[3:] else ''})"
        )
    if name in keys:
        return name
    for array in _PREFERRED:
        if f"{name}/{array}" in keys:
            return f"{name}/{array}"
    inside = [key for key in names if key.startswith(f"{name}/")]
    if len(inside) == 1:
        return inside[0]
    candidates = sorted({*names, *(key.rpartition("/")[0] or key for key in names)})
    nearest = difflib.get_close_matches(name, candidates, n=1, cutoff=0.0)
    hint = f"; the nearest is '{nearest[0]}'" if nearest else "; the file is empty"
    raise SourceError(f"{path}: no clip '{name}'{hint}")


def _keypoints(path: Path, key: str, array: NDArray[Any]) -> Floats:
    if array.dtype.kind not in "fiu" or array.ndim != 3 or array.shape[1:] != (KEYPOINTS, 3):
        raise SourceError(f"{path}: '{key}' is {array.dtype} {array.shape}, expected numbers (frames, {KEYPOINTS}, 3)")
    if len(array) == 0:
        raise SourceError(f"{path}: '{key}' holds no frame")
    keypoints = array.astype(np.float64)
    if not np.isfinite(keypoints).all(axis=2).any():
        raise SourceError(f"{path}: '{key}' holds no keypoint in any of its {len(array)} frames, all are NaN")
    return keypoints


def _fps(path: Path, key: str, array: NDArray[Any]) -> float:
    value = float(array.flat[0]) if array.size == 1 and array.dtype.kind in "fiu" else math.nan
    if not 1.0 <= value <= _MAX_FPS_HZ:
        raise SourceError(f"{path}: '{key}' is {array.tolist()}, expected one number within 1..{_MAX_FPS_HZ:g}")
    return value


def _image_size(path: Path, key: str, array: NDArray[Any]) -> tuple[int, int]:
    if array.size != 2 or array.dtype.kind not in "fiu" or not (array > 0).all() or not np.isfinite(array).all():
        raise SourceError(f"{path}: '{key}' is {array.tolist()}, expected width and height in pixels")
    return int(array.flat[0]), int(array.flat[1])
