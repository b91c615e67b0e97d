"""What every data set becomes: clips of twelve keypoints with their origin."""

from __future__ import annotations

import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from bridge.errors import SourceError
from bridge.messages import KEYPOINTS, Floats

Labels = NDArray[np.int64]

STABLE: Final = 0
TRANSIENT: Final = 1
FALL: Final = 2
UNLABELLED: Final = -100  # the value torch's cross-entropy ignores


@dataclass(frozen=True, slots=True)
class Clip:
    """One person in one recording, as an estimator saw it.

    `group` names what must stay on one side of a split: everything filmed of the
    same event, by whichever estimator it was tracked.
    """

    name: str
    group: str
    keypoints: Floats  # (N, 12, 3) x px, y px, confidence; NaN where not found
    fps: float  # [Hz]
    labels: Labels | None  # (N,) STABLE, TRANSIENT, FALL or UNLABELLED
    width: int  # [px]
    height: int  # [px]
    source: str
    licence: str

    def __post_init__(self) -> None:
        if self.keypoints.ndim != 3 or self.keypoints.shape[1:] != (KEYPOINTS, 3):
            raise SourceError(f"{self.name}: keypoints have shape {self.keypoints.shape}, expected (N, {KEYPOINTS}, 3)")
        if self.labels is not None and len(self.labels) != len(self.keypoints):
            raise SourceError(f"{self.name}: {len(self.labels)} labels for {len(self.keypoints)} frames")

    def stamps_ns(self) -> NDArray[np.int64]:
        """Return the capture stamps of the frames, (N,) [ns], the first at zero."""
        return np.round(np.arange(len(self.keypoints)) * (1e9 / self.fps)).astype(np.int64)


def data_folder(option: Path | None) -> Path:
    """Return the folder of the research data: the option, else `SUREFOOT_DATA`.

    Raises:
        SourceError: neither is set, or the folder is not there.
    """
    named = option or (Path(os.environ["SUREFOOT_DATA"]) if os.environ.get("SUREFOOT_DATA") else None)
    if named is None:
        raise SourceError("no research data: name its folder with --data or the environment variable SUREFOOT_DATA")
    if not named.is_dir():
        raise SourceError(f"no research data in '{named}': not a folder (--data or SUREFOOT_DATA)")
    return named


def required(folder: Path, relative: str) -> Path:
    """Return `folder / relative`.

    Raises:
        SourceError: the file is not there.
    """
    path = folder / relative
    if not path.is_file():
        raise SourceError(f"research data is incomplete: '{relative}' is not in '{folder}' (--data or SUREFOOT_DATA)")
    return path


class Arrays(dict[str, Floats]):
    """The arrays of one file; asking for one that is not there names the file."""

    def __init__(self, path: Path, arrays: dict[str, Floats]) -> None:
        super().__init__(arrays)
        self._path = path

    def __missing__(self, name: str) -> Floats:
        raise SourceError(f"research data '{self._path}' has no array '{name}'")


def load_arrays(path: Path) -> Arrays:
    """Read the numeric arrays of an npz file, without pickle.

    Raises:
        SourceError: the file is damaged; later, when an array is asked for that is not in it.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return Arrays(path, {name: np.asarray(archive[name], dtype=np.float64) for name in archive.files})
    except (OSError, ValueError, EOFError, zlib.error, BadZipFile) as error:
        raise SourceError(f"research data '{path}' cannot be read: {error}") from error
