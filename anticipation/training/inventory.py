"""What research data is there, whether it is what it should be, and how much of each class."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from anticipation.training import lafan1, mocap, oumvlp, upfall, urfd
from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Clip, load_arrays
from anticipation.training.evaluation.recordings import read_partial
from anticipation.training.samples import Track
from bridge.errors import SourceError

CLASSES: Final = {"stable": STABLE, "transient": TRANSIENT, "fall": FALL, "unlabelled": UNLABELLED}
ANGLES_CHECKED: Final = 20  # sequences of OUMVLP-Pose that are read; there are 260,000
TALLEST_M: Final = 3.5  # from the lowest to the highest keypoint of a clip, jumps and climbing included
FPS_LIMITS: Final = (5.0, 240.0)


class File(NamedTuple):
    """A file or folder of the research data."""

    path: str  # in the data folder
    purpose: str
    needed: bool  # by `surefoot train` and `surefoot evaluate`


FILES: Final = (
    File("urfd/falls.npz", "URFD falls by two estimators: training and test", True),
    File("urfd/adls.npz", "URFD daily activities: negatives", True),
    File("upfall/subject1_cam1.npz", "UP-Fall falls and daily activities: training and test", True),
    File("mocap/bandai_namco.npz", "motion capture of walking and gestures: training", True),
    File("mocap/cmu.npz", "motion capture of walking: training", True),
    File("mocap/lafan1.npz", "motion capture with falls: test", False),
    File("mocap/lafan1_ground_events.json", "where the falls are in LaFAN1: test", False),
    File("urfd/labels_falls.csv", "URFD's labels, to check the arrays against", False),
    File("urfd/labels_adls.csv", "the same for daily activities", False),
    File("urfd/videos", "videos for `surefoot up --source`", False),
    File("oumvlp", "OUMVLP-Pose, walks of many people: training", False),
    File("push_recovery/human-data.csv", "pushes that people recover from: simulation", False),
    File("weights/movenet_lightning_int8.tflite", "MoveNet, for `perception.movenet.weights`", False),
)


@dataclass(frozen=True, slots=True)
class Source:
    """What one source holds."""

    name: str
    licence: str
    clips: int
    frames: int
    seconds: float
    classes: dict[str, int]  # frames of each class
    problems: tuple[str, ...] = ()


class Inventory(NamedTuple):
    """What is in the data folder."""

    sources: list[Source]
    missing: list[File]
    problems: list[str]  # of all sources, and of what lies beside them


def take_stock(folder: Path) -> Inventory:
    """Read and check everything in the data folder.

    Raises:
        SourceError: nothing is there.
    """
    missing = [file for file in FILES if not (folder / file.path).exists()]
    if len(missing) == len(FILES):
        raise SourceError(f"no research data in '{folder}': none of {', '.join(file.path for file in FILES[:5])}, ...")
    gone = {file.path for file in missing}
    sources: list[Source] = []
    problems: list[str] = []
    for needs, read in _READERS:
        if gone & set(needs):
            continue
        try:
            sources += read(folder)
        except SourceError as error:
            problems.append(str(error))
    problems += [f"{source.name}: {problem}" for source in sources for problem in source.problems]
    return Inventory(sources, missing, problems + _labels_differ(folder))


def describe(name: str, clips: Sequence[Clip]) -> Source:
    """Count and check clips as a reader gives them."""
    problems = [problem for clip in clips for problem in check(clip)]
    labels = [clip.labels if clip.labels is not None else np.full(len(clip.keypoints), UNLABELLED) for clip in clips]
    return Source(
        name=name,
        licence=clips[0].licence if clips else "",
        clips=len(clips),
        frames=sum(len(clip.keypoints) for clip in clips),
        seconds=sum(len(clip.keypoints) / clip.fps for clip in clips),
        classes=_count(labels),
        problems=tuple(problems) if clips else ("no clip",),
    )


def describe_tracks(name: str, licence: str, tracks: Sequence[Track], problems: Iterable[str]) -> Source:
    """Count tracks on the 30 Hz grid."""
    frames = sum(len(track.frames) for track in tracks)
    classes = _count([track.labels for track in tracks])
    return Source(name, licence, len(tracks), frames, frames / 30.0, classes, tuple(problems))


def check(clip: Clip) -> list[str]:
    """Say what is wrong with a clip, '' being what a reader has checked already: shape and number of labels."""
    found = []
    position, confidence = clip.keypoints[..., :2], clip.keypoints[..., 2]
    if len(clip.keypoints) == 0:
        return [f"{clip.name} holds no frame"]
    if np.isinf(clip.keypoints).any():
        found.append(f"{clip.name} holds an infinite number")
    if (np.isnan(position[..., 0]) != np.isnan(position[..., 1])).any():
        found.append(f"{clip.name} has keypoints with one coordinate only")
    if not np.isfinite(position).any():
        found.append(f"{clip.name} holds no keypoint in any frame")
    if (np.isfinite(confidence) & ((confidence < 0.0) | (confidence > 1.5))).any():
        found.append(f"{clip.name} has confidences from {np.nanmin(confidence):g} to {np.nanmax(confidence):g}")
    if not FPS_LIMITS[0] <= clip.fps <= FPS_LIMITS[1]:
        found.append(f"{clip.name} has {clip.fps:g} frames a second, limits {FPS_LIMITS[0]:g}..{FPS_LIMITS[1]:g}")
    if clip.labels is not None and not np.isin(clip.labels, list(CLASSES.values())).all():
        found.append(f"{clip.name} has labels {sorted(set(clip.labels.tolist()) - set(CLASSES.values()))}")
    return found


def _count(labels: Sequence[np.ndarray[tuple[int], np.dtype[np.int64]]]) -> dict[str, int]:
    return {name: sum(int((each == value).sum()) for each in labels) for name, value in CLASSES.items()}


def _urfd(folder: Path) -> list[Source]:
    return [
        describe("URFD falls, AlphaPose", urfd.read_falls(folder, "alphapose")),
        describe("URFD falls, MoveNet", urfd.read_falls(folder, "movenet")),
    ]


def _urfd_daily(folder: Path) -> list[Source]:
    partial = read_partial(folder)
    exact = describe("URFD adl-40", urfd.read_daily(folder))
    return [exact, describe("URFD daily, 8 keypoints", partial)] if partial else [exact]


def _upfall(folder: Path) -> list[Source]:
    clips = upfall.read(folder)
    return [
        describe("UP-Fall falls", [clip for clip in clips if upfall.is_fall(clip)]),
        describe("UP-Fall daily", [clip for clip in clips if not upfall.is_fall(clip)]),
    ]


def _motion(name: str, file: str, licence: str, folder: Path) -> Source:
    """Count and check motion capture, points (T, 12, 3) [m], z up."""
    motions = load_arrays(folder / file)
    problems = []
    for key, points in motions.items():
        if points.shape[1:] != (12, 3) or len(points) == 0:
            problems.append(f"{key} has shape {points.shape}, expected (T, 12, 3)")
        elif not np.isfinite(points).all():
            problems.append(f"{key} is not finite")
        elif (extent := float(np.ptp(points[..., 2]))) > TALLEST_M:
            problems.append(f"{key} reaches over {extent:.1f} m of height, limit {TALLEST_M} m")
    frames = sum(len(points) for points in motions.values())
    classes = dict.fromkeys(CLASSES, 0) | {"unlabelled": frames}
    return Source(name, licence, len(motions), frames, frames / mocap.FPS, classes, tuple(problems))


def _bandai(folder: Path) -> list[Source]:
    return [_motion("Bandai Namco", "mocap/bandai_namco.npz", mocap.LICENCES["bandai_namco"], folder)]


def _cmu(folder: Path) -> list[Source]:
    return [_motion("CMU", "mocap/cmu.npz", mocap.LICENCES["cmu"], folder)]


def _lafan1(folder: Path) -> list[Source]:
    return [_motion("LaFAN1", "mocap/lafan1.npz", lafan1.LICENCE, folder)]


def _lafan1_contacts(folder: Path) -> list[Source]:
    return [
        describe("LaFAN1 falls, one camera", lafan1.read_falls(folder, cameras=1, seed=0)),
        describe("LaFAN1 to the ground, no fall", lafan1.read_others(folder, cameras=1, seed=0)),
    ]


def _oumvlp(folder: Path) -> list[Source]:
    """Count all sequences, but read only some: there may be a quarter of a million."""
    found = []
    for estimator in oumvlp.ESTIMATORS:
        if oumvlp.is_there(folder, estimator):
            people = [path for path in (folder / oumvlp.FOLDER / estimator).iterdir() if path.is_dir()]
            count = sum(len(oumvlp.sequences(path)) for path in people)
            part = describe("", oumvlp.read(folder, estimator, ANGLES_CHECKED, seed=0))
            scale = count / max(1, part.clips)
            classes = {name: round(frames * scale) for name, frames in part.classes.items()}
            name = f"OUMVLP-Pose {estimator}, {len(people)} people (frames estimated)"
            seconds = part.seconds * scale
            frames = round(part.frames * scale)
            found.append(Source(name, oumvlp.LICENCE, count, frames, seconds, classes, part.problems))
    return found


def _labels_differ(folder: Path) -> list[str]:
    """Compare the labels of the URFD arrays with the dataset's own tables."""
    found = []
    for table, file in (("urfd/labels_falls.csv", "urfd/falls.npz"), ("urfd/labels_adls.csv", "urfd/adls.npz")):
        if not (folder / table).is_file() or not (folder / file).is_file():
            continue
        try:
            arrays = load_arrays(folder / file)
            given: dict[str, list[int]] = {}
            with (folder / table).open(newline="", encoding="utf-8") as rows:
                for row in csv.DictReader(rows):
                    given.setdefault(row["sequence"], []).append(int(row["label"]))
        except (SourceError, OSError, ValueError, KeyError, csv.Error) as error:
            found.append(f"{table} cannot be compared with {file}: {error!r}")
            continue
        for key in arrays:
            name, _, kind = key.partition("/")
            if kind == "label" and not np.array_equal(arrays[key], given.get(name, [])):
                found.append(f"{file}: the labels of {name} are not those of {table}")
    return found


_READERS: Final[tuple[tuple[tuple[str, ...], Callable[[Path], list[Source]]], ...]] = (
    (("urfd/falls.npz",), _urfd),
    (("urfd/adls.npz",), _urfd_daily),
    (("upfall/subject1_cam1.npz",), _upfall),
    (("mocap/bandai_namco.npz",), _bandai),
    (("mocap/cmu.npz",), _cmu),
    (("mocap/lafan1.npz",), _lafan1),
    (("mocap/lafan1.npz", "mocap/lafan1_ground_events.json"), _lafan1_contacts),
    (("oumvlp",), _oumvlp),
)
