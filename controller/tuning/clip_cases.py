"""Cases from keypoint files: each clip through perception and anticipation once, as `surefoot assess` runs them."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import numpy as np

from bridge.clock import NS, nanoseconds
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.lockstep import LockStep
from bridge.messages import FallHorizon
from bridge.topics import FALL_HORIZON
from controller.tuning.cases import Case, HorizonColumns, Horizons, Ints
from controller.tuning.falls import labelled_falls
from controller.tuning.judging import Judge

START_NS: Final = 1_000 * NS
PREFERRED: Final = ("keypoints", "alphapose", "movenet")  # of several detectors' arrays of one clip


class ClipJob(NamedTuple):
    """One clip whose horizons are wanted; plain values, so that it travels."""

    path: Path
    clip: str  # 'NAME' or 'NAME/ARRAY', as the reader names it
    name: str
    group: str


def clip_jobs(path: Path, wanted: str, called: str) -> list[ClipJob]:
    """Return the clips of a file.

    Args:
        path: the npz file.
        wanted: 'CLIP' or 'CLIP/ARRAY', with wildcards; '' for every clip. Where a clip has arrays of several
            detectors and none is named, one is taken: a fall seen by two of them is still one fall.
        called: what names begin with.

    Raises:
        SourceError: a file that cannot be read, or without such a clip.
    """
    names: list[str] = import_module("perception.sources.keypoint_file").clip_names(path)
    if not names:
        raise SourceError(f"{path}: no clip in it, expected arrays NAME/keypoints and NAME/fps")
    of: dict[str, list[str]] = {}
    for name in names:
        of.setdefault(_base(name, names), []).append(name)
    picked: list[ClipJob] = []
    for base, arrays in of.items():
        exact = [name for name in arrays if name != base and wanted and fnmatchcase(name, wanted)]
        chosen = exact or ([_preferred(arrays)] if not wanted or fnmatchcase(base, wanted) else [])
        picked.extend(ClipJob(path, name, f"{called}:{name}", f"{called}:{base}") for name in chosen)
    if not picked:
        raise SourceError(f"{path}: no clip '{wanted}' in it; it holds {', '.join(list(of)[:4])}"
                          + (f" and {len(of) - 4} more" if len(of) > 4 else ""))  # fmt: skip
    return picked


def clip_case(job: ClipJob, config: SurefootConfig, known: Horizons | None = None) -> Case:
    """Return one clip as a case: the walker healthy and unloaded, horizons as soon as their frame.

    `known` are its horizons, if they were made before.

    Raises:
        SourceError: the clip cannot be read, or its labels do not fit.
    """
    clip: Any = import_module("perception.sources.keypoint_file").read_clip(
        job.path, job.clip, config.perception.source
    )
    stamps_ns: list[int] = clip.stamps_ns
    period_ns = nanoseconds(1.0 / config.controller.rate_hz)
    label = _label(job, len(stamps_ns))
    times_s = np.array(stamps_ns) / NS
    return Case(
        job.name,
        job.group,
        START_NS,
        period_ns,
        stamps_ns[-1] // period_ns + 2,
        foresee(job, stamps_ns, config) if known is None else known,
        falls=() if label is None else labelled_falls(label, times_s),
        labelled=label is not None,
    )


def foresee(job: ClipJob, stamps_ns: Sequence[int], config: SurefootConfig) -> Horizons:
    """Return the horizons that perception and anticipation make of a clip, in simulated time."""
    system = LockStep(
        config,
        {
            "perception": ("perception.node", {"source": f"{job.path}:{job.clip}"}),
            "anticipation": ("anticipation.node", {}),
        },
        START_NS,
    )
    judge, columns = Judge(FALL_HORIZON, config.inputs.stuck_after_s), HorizonColumns(FALL_HORIZON.key)

    def take(sample: Any) -> None:
        if (one := judge.judge(sample)) is not None:
            columns.add(cast(FallHorizon, one.message), one.arrival_ns, one.fault)

    try:
        system.hub.transport().subscribe(FALL_HORIZON, take)
        for offset_ns in stamps_ns:
            system.advance_to(START_NS + offset_ns)
    finally:
        system.close()
    return columns.horizons()


def _base(name: str, names: Sequence[str]) -> str:
    """Return the clip that an array belongs to: 'fall-01' for 'fall-01/movenet', if that is a detector's name."""
    base, _, last = name.rpartition("/")
    several = sum(other.rpartition("/")[0] == base for other in names) > 1
    return base if base and (last in PREFERRED or several) else name


def _preferred(arrays: Sequence[str]) -> str:
    for last in PREFERRED:
        for name in arrays:
            if name.endswith(f"/{last}"):
                return name
    return arrays[0]


def _label(job: ClipJob, frames: int) -> Ints | None:
    """Return the labels beside a clip, (N,); None if there are none."""
    with np.load(job.path, allow_pickle=False) as arrays:
        key = next((key for key in (f"{job.clip}/label", f"{job.clip.rpartition('/')[0]}/label") if key in arrays), "")
        if not key:
            return None
        label: Ints = np.asarray(arrays[key])
    if label.shape != (frames,) or label.dtype.kind not in "iuf" or not np.isin(label, (-1, 0, 1)).all():
        raise SourceError(
            f"{job.path}: '{key}' is {label.dtype} {label.shape}, expected {frames} of -1 upright, 0 falling, 1 lying"
        )
    return label.astype(np.int64)
