"""What held-out checkpoints said of every clip: all that tables, pictures and calibration are computed from.

One npz file holds everything, without pickle: `meta` is JSON text with one entry for each clip, and the arrays of
clip k are called `k/FIELD`. Reading it back needs neither networks nor research data.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Literal
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from anticipation.training.clips import Labels
from bridge.errors import SourceError
from bridge.messages import Floats

FORMAT: Final = 1

Kind = Literal["fall", "staged", "daily", "partial", "walk"]
"""URFD falls, UP-Fall falls, daily activities, daily activities of eight keypoints, motion capture."""


@dataclass(frozen=True, slots=True, eq=False)
class Ticks:
    """A clip on the 30 Hz grid with the horizon that starts at each tick; NaN where there was none.

    Probabilities are those before calibration (temperature 1).
    """

    stamps_ns: NDArray[np.int64]  # (T,)
    labels: Labels  # (T,) of the data set
    tested: NDArray[np.bool_]  # (T,) the window of 15 is whole, and no network learnt it
    whole: NDArray[np.bool_]  # (T,) every keypoint measured or filled
    poses: NDArray[np.float32]  # (T, 12, 2) relative to the upper-body centre [body lengths]
    centre_px: NDArray[np.float32]  # (T, 2) upper-body centre [px]
    body_px: NDArray[np.float32]  # (T,) body length [px]
    valid: NDArray[np.bool_]  # (T,) there is a horizon
    quality: NDArray[np.float32]  # (T,)
    probabilities: NDArray[np.float32]  # (T, 16, 3)
    distance: NDArray[np.float32]  # (T, 16) to the fall boundary [sd]
    plane: NDArray[np.float32]  # (T, 16, 2) [sd]
    forecast: NDArray[np.float16]  # (T, 15, 12, 2) relative to the foreseen upper-body centre [body lengths]
    rows: Mapping[str, NDArray[np.int8]] = field(default_factory=dict)  # (T, 16) classes by simpler ways, -1: none
    planes: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)  # (T, 2) distance and region, present step

    def __len__(self) -> int:
        return len(self.stamps_ns)


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """A clip frame by frame, as the whole system met it: perception, anticipation, intervention."""

    stamps_ns: NDArray[np.int64]  # (N,)
    labels: Labels  # (N,) of the data set
    state: NDArray[np.str_]  # (N,) of the supervisor
    stiffening: NDArray[np.float32]  # (N,)
    quality: NDArray[np.float32]  # (N,)
    probabilities: NDArray[np.float32]  # (N, 16, 3) calibrated; NaN without a horizon
    distance: NDArray[np.float32]  # (N, 16) [sd]


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One clip."""

    name: str
    group: str
    source: str
    kind: Kind
    part: int  # index of the checkpoint that had not seen it
    ticks: Ticks | None = None
    frames: Frames | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Every clip of an evaluation."""

    meta: Mapping[str, Any]  # protocol, seed, parts, data, ...
    records: Sequence[Record]
    planes: Sequence[Mapping[str, Floats]] = ()  # of each part: centres, weights, biases

    def of(self, *kinds: Kind, estimator: str = "") -> list[Record]:
        """Return the records of some kinds; of the URFD falls, those of one estimator if it is named."""
        return [
            record
            for record in self.records
            if record.kind in kinds and (record.kind != "fall" or record.name.endswith(estimator))
        ]


def save(predictions: Predictions, path: Path) -> None:
    """Write everything to `path`, whole or not at all."""
    arrays: dict[str, NDArray[Any]] = {}
    entries = []
    for index, record in enumerate(predictions.records):
        entry: dict[str, Any] = {name: getattr(record, name) for name in ("name", "group", "source", "kind", "part")}
        for part in ("ticks", "frames"):
            content = getattr(record, part)
            if content is None:
                continue
            entry[part] = [item.name for item in fields(content)]
            for item in fields(content):
                value = getattr(content, item.name)
                if isinstance(value, Mapping):
                    entry[f"{part}.{item.name}"] = list(value)
                    arrays |= {f"{index}/{part}/{item.name}/{at}": each for at, each in enumerate(value.values())}
                else:
                    arrays[f"{index}/{part}/{item.name}"] = value
        entries.append(entry)
    for number, plane in enumerate(predictions.planes):
        arrays |= {f"plane/{number}/{name}": array for name, array in plane.items()}
    meta = {"format": FORMAT, **predictions.meta, "planes": len(predictions.planes), "clips": entries}
    text = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    part_path = path.with_name(path.name + ".part")
    with part_path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **{"meta": text, **arrays})
    part_path.replace(path)


def load(path: Path) -> Predictions:
    """Read what `save` wrote.

    Raises:
        SourceError: missing, damaged, or of another format.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        meta = json.loads(arrays["meta"].tobytes().decode())
        if meta.pop("format") != FORMAT:
            raise SourceError(f"predictions '{path}' are of another format: run the evaluation again")
        planes = [_below(arrays, f"plane/{number}/") for number in range(meta.pop("planes"))]
        records = [_record(arrays, index, entry) for index, entry in enumerate(meta.pop("clips"))]
    except (OSError, ValueError, KeyError, EOFError, zlib.error, BadZipFile) as error:
        raise SourceError(f"predictions '{path}' cannot be read: {error}") from error
    return Predictions(meta, records, planes)


def _record(arrays: Mapping[str, NDArray[Any]], index: int, entry: Mapping[str, Any]) -> Record:
    def part(name: str, kind: type[Any]) -> Any:
        if name not in entry:
            return None
        values = {}
        for item in entry[name]:
            key, names = f"{index}/{name}/{item}", entry.get(f"{name}.{item}")
            values[item] = (
                arrays[key] if names is None else {each: arrays[f"{key}/{at}"] for at, each in enumerate(names)}
            )
        return kind(**values)

    return Record(
        entry["name"], entry["group"], entry["source"], entry["kind"], entry["part"],
        part("ticks", Ticks), part("frames", Frames),
    )  # fmt: skip


def _below(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, Floats]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
