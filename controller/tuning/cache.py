"""Horizons of keypoint clips, kept on disk: a second study of the same clips begins at once."""

from __future__ import annotations

import hashlib
import os
import zipfile
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from controller.tuning.cases import Case, Horizons, Stream
from controller.tuning.clip_cases import ClipJob, clip_case

FORMAT: Final = 1
MAKERS: Final = ("perception", "anticipation")  # packages that turn keypoints into horizons
_DAMAGE: Final = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


class Cache:
    """A folder of horizons. The name of each is a digest of all that could change it.

    That is the clip, `[perception]`, `[anticipation]`, `[inputs]`, the checkpoint, and the code and weights of the
    packages that make horizons. Nothing is deleted: the folder may be removed at any time.
    """

    def __init__(self, folder: Path, config: SurefootConfig) -> None:
        """Use `folder`, and make it if it is not there.

        Raises:
            SourceError: the folder cannot be made.
        """
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SourceError(f"--cache {folder}: cannot be made: {error.strerror}") from error
        digest = hashlib.sha256(f"{FORMAT}".encode())
        for section in (config.perception, config.anticipation, config.inputs):
            digest.update(section.model_dump_json().encode())
        digest.update(f"{config.controller.rate_hz}".encode())
        checkpoint = config.anticipation.checkpoint
        own = [Path(checkpoint)] if Path(checkpoint).is_file() else []  # weights by name are among the package's files
        for path in [*own, *_code()]:
            digest.update(str(path).encode() + path.read_bytes())
        self._common = digest.hexdigest()

    def clip_case(self, job: ClipJob, config: SurefootConfig) -> Case:
        """Return the case of a clip, with the horizons kept or newly made."""
        file = self._folder / f"{self._name(job)}.npz"
        kept = _read(file)
        if kept is None:
            case = clip_case(job, config)
            _write(file, case.horizons)
            return case
        return clip_case(job, config, kept)

    def _name(self, job: ClipJob) -> str:
        digest = hashlib.sha256(self._common.encode())
        with np.load(job.path, allow_pickle=False) as arrays:
            base = job.clip.rpartition("/")[0]
            for key in sorted(arrays.files):
                if key.startswith(job.clip) or key in (f"{base}/fps", f"{base}/image_size"):
                    value = np.ascontiguousarray(arrays[key])
                    digest.update(f"{key} {value.dtype} {value.shape}".encode() + value.tobytes())
        return digest.hexdigest()[:32]


def _code() -> list[Path]:
    files: list[Path] = []
    for package in MAKERS:
        spec = find_spec(package)
        for folder in spec.submodule_search_locations or [] if spec is not None else []:
            files += [path for path in Path(folder).rglob("*") if path.is_file() and _counts(path)]
    return sorted(files)


def _counts(path: Path) -> bool:
    return path.suffix in (".py", ".safetensors", ".json", ".msg") and "training" not in path.parts


def _read(file: Path) -> Horizons | None:
    """Return what is kept; None if nothing is, or it is damaged."""
    try:
        with np.load(file, allow_pickle=False) as arrays:
            faults = tuple(str(fault) for fault in arrays["faults"])
            stream = Stream(str(arrays["key"]), arrays["arrival_ns"], arrays["stamp_ns"], faults)
            values = [arrays[name] for name in ("probabilities", "distance", "distance_rate", "quality", "step_s")]
    except _DAMAGE:
        return None
    return Horizons(stream, *values)


def _write(file: Path, horizons: Horizons) -> None:
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    of = horizons.stream
    try:
        with part.open("wb") as opened:
            np.savez_compressed(
                opened, faults=np.array(of.faults, dtype=np.str_), key=of.key, arrival_ns=of.arrival_ns,
                stamp_ns=of.stamp_ns, probabilities=horizons.probabilities, distance=horizons.distance,
                distance_rate=horizons.distance_rate, quality=horizons.quality, step_s=horizons.step_s,
            )  # fmt: skip
        part.replace(file)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SourceError(f"--cache {file.parent}: cannot be written: {error.strerror}") from error
