"""A motion-capture clip: the twelve keypoints of a person over time, in metres.

An npz file holds clips by name, each (T, 12, 3): COCO's shoulders to ankles, left before right, z up, 30 frames a
second unless an array NAME/fps says otherwise.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

import numpy as np

from bridge.errors import SourceError
from bridge.messages import Floats

FPS_HZ: Final = 30.0
SHORTEST_S: Final = 1.0
HALF_A_WINDOW: Final = 3
SMOOTHING: Final = np.array([-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0]) / 21.0  # quadratic over 7 frames (Savitzky, Golay)
LEG_M: Final = (0.3, 1.5)  # hip to knee to ankle: what is no leg is no motion in metres
ON_FLOOR: Final = 2.0  # percentile of the lowest ankle that stands
_DAMAGE: Final = (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error, NotImplementedError)


@dataclass(frozen=True, eq=False)
class Clip:
    """One person in motion; compared by identity."""

    name: str
    points_m: Floats  # (T, 12, 3), the lowest ankle at height 0, smoothed
    fps_hz: float

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame [s]."""
        return (len(self.points_m) - 1) / self.fps_hz


def load_clip(spec: str, from_s: float = 0.0, most_s: float = 600.0) -> Clip:
    """Read `FILE.npz:NAME`, or `FILE.npz` with a single clip, from `from_s` on and at most `most_s` long.

    Raises:
        SourceError: says which file, clip or value cannot be used, and why.
    """
    file, colon, name = spec.rpartition(":")
    if not colon or not file.endswith(".npz"):
        file, name = spec, ""
    path = Path(file)
    if not path.is_file():
        raise SourceError(f"clip {spec}: no such file as {path}; expected FILE.npz:NAME")
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as arrays:
            name = _chosen(spec, name, arrays)
            points = np.asarray(arrays[name], dtype=np.float64)
            fps_hz = float(arrays[f"{name}/fps"]) if f"{name}/fps" in arrays else FPS_HZ
    except SourceError:
        raise
    except (*_DAMAGE, TypeError, AttributeError) as error:
        said = (str(error).splitlines() or [type(error).__name__])[0]
        raise SourceError(f"clip {spec}: not a readable npz file of clips ({said})") from error
    return clip_of(f"{path.name}:{name}", points, fps_hz, from_s, most_s)


def clip_of(name: str, points_m: Floats, fps_hz: float = FPS_HZ, from_s: float = 0.0, most_s: float = 600.0) -> Clip:
    """Return the clip of points (T, 12, 3) [m].

    Raises:
        SourceError: wrong shape or rate, numbers missing, too short, or no person of human size.
    """
    if points_m.ndim != 3 or points_m.shape[1:] != (12, 3):
        raise SourceError(f"clip {name}: shape {points_m.shape}, expected (frames, 12, 3)")
    if not 10.0 <= fps_hz <= 1000.0:
        raise SourceError(f"clip {name}: {fps_hz:g} frames a second, must lie within [10, 1000]")
    whole_s = (len(points_m) - 1) / fps_hz
    first = round(from_s * fps_hz)
    points = np.array(points_m[first : first + round(most_s * fps_hz) + 1], dtype=np.float64)
    duration_s = (len(points) - 1) / fps_hz
    if duration_s < SHORTEST_S:
        raise SourceError(
            f"clip {name}: {max(whole_s - from_s, 0.0):.2f} s from {from_s:g} s on, must be at least {SHORTEST_S:g} s"
        )
    wrong = np.flatnonzero(~np.isfinite(points).all(axis=(1, 2)))
    if len(wrong):
        raise SourceError(f"clip {name}: frame {first + wrong[0]} has coordinates that are not finite")
    leg_m = leg_length(points)
    if not LEG_M[0] <= leg_m <= LEG_M[1]:
        raise SourceError(f"clip {name}: legs of {leg_m:.2f} m, must lie within [{LEG_M[0]:g}, {LEG_M[1]:g}]: metres?")
    smooth = _smoothed(points)
    smooth[..., 2] -= np.percentile(smooth[:, 10:, 2].min(axis=1), ON_FLOOR)
    return Clip(name, smooth, fps_hz)


def leg_length(points_m: Floats) -> float:
    """Return hip to knee to ankle of points (T, 12, 3), the median over both legs and all frames [m]."""
    thigh = np.linalg.norm(points_m[:, 6:8] - points_m[:, 8:10], axis=-1)
    shank = np.linalg.norm(points_m[:, 8:10] - points_m[:, 10:12], axis=-1)
    return float(np.median(thigh + shank))


def _chosen(spec: str, name: str, arrays: Mapping[str, Any]) -> str:
    names = [key for key in arrays if not key.endswith("/fps")]
    if name in names:
        return name
    if not name and len(names) == 1:
        return names[0]
    near = get_close_matches(name, names, n=3, cutoff=0.4) or names[:3]
    asked = f"no clip '{name}'" if name else "name one of its clips"
    raise SourceError(f"clip {spec}: {asked}; it holds {len(names)}, such as {', '.join(near)}")


def _smoothed(points: Floats) -> Floats:
    flat = points.reshape(len(points), -1)
    edges = np.pad(flat, ((HALF_A_WINDOW, HALF_A_WINDOW), (0, 0)), mode="reflect", reflect_type="odd")
    columns = [np.convolve(column, SMOOTHING, "valid") for column in edges.T]
    return np.stack(columns, axis=1).reshape(points.shape)
