"""How two pose estimators differ that saw the same video: the numbers that `detector` draws its noise from.

python -m anticipation.training.detector_statistics --data FOLDER     (or: surefoot data --noise)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from anticipation.training import detector, urfd
from anticipation.training.clips import FALL, data_folder
from bridge.command_line.options import DataOption
from bridge.command_line.output import result_console
from bridge.messages import KEYPOINTS, Floats
from perception.skeleton import NAMES

APART: Final = 0.2  # least distance between left and right at which an exchange can be told [torso lengths]
FAR: Final = 0.5  # a point is misplaced when the two see it further apart [torso lengths]
LOW: Final = 0.2  # confidence that perception treats as not seen
_TO_SIGMA: Final = 1.4826  # median absolute deviation to standard deviation of a Gaussian


class Statistics(NamedTuple):
    """How the tracks of two estimators differ, over the frames in which both found the person."""

    frames: int
    spread: Floats  # (12,) robust standard deviation of the difference, mean of both axes [torso lengths]
    misplaced: Floats  # (12,) share of frames further apart than FAR
    swapped: Floats  # (6,) share of the frames with left and right apart in which a pair is exchanged; NaN if none
    jitter: Floats  # (2,) what changes from frame to frame, of each estimator [torso lengths]
    faint: Floats  # (2, 12) share of the frames with confidence below LOW, of each estimator
    blind: Floats  # (2,) share of frames without anybody after the first with somebody, of each estimator


def compare(pairs: Sequence[tuple[Floats, Floats]]) -> Statistics:
    """Compare the tracks (N, 12, 3) that two estimators gave of the same clips.

    Raises:
        ValueError: there is no frame in which both found the person.
    """
    rows: list[Floats] = []
    seconds: tuple[list[Floats], list[Floats]] = ([], [])
    blind: tuple[list[Floats], list[Floats]] = ([], [])
    for pair in pairs:
        there = [np.asarray(np.isfinite(track[..., 0]).all(axis=1)) for track in pair]
        both = there[0] & there[1]
        if not both.any():
            continue
        trunk = pair[0][both, 0:2, :2].mean(axis=1) - pair[0][both, 6:8, :2].mean(axis=1)
        torso = float(np.median(np.linalg.norm(trunk, axis=-1)))
        scale = np.array([torso, torso, 1.0])
        rows.append(np.stack([track[both] / scale for track in pair]))
        for index, track in enumerate(pair):
            second = np.diff(track[..., :2], n=2, axis=0) / torso
            seconds[index].append(second[np.isfinite(second).all(axis=(1, 2))])
            blind[index].append(np.asarray(~there[index][int(np.argmax(there[index])) :], dtype=np.float64))
    if not rows:
        raise ValueError("no frame in which both estimators found the person")
    first, other = np.concatenate(rows, axis=1)
    difference = first[..., :2] - other[..., :2]
    return Statistics(
        frames=len(first),
        spread=_robust(difference).mean(axis=-1),
        misplaced=(np.linalg.norm(difference, axis=-1) > FAR).mean(axis=0),
        swapped=_swapped(first[..., :2], other[..., :2]),
        # the second difference of white noise has six times its variance
        jitter=np.array([_robust(np.concatenate(part)).mean() for part in seconds]) / np.sqrt(6.0),
        faint=np.stack([(track[..., 2] < LOW).mean(axis=0) for track in (first, other)]),
        blind=np.array([np.concatenate(part).mean() for part in blind]),
    )


def measure(folder: Path) -> Statistics:
    """Compare AlphaPose and MoveNet on the standing and falling frames of the URFD falls.

    Raises:
        SourceError: the file is missing or damaged.
    """
    pairs = []
    for one, other in zip(urfd.read_falls(folder, "alphapose"), urfd.read_falls(folder, "movenet"), strict=True):
        assert one.labels is not None
        upright = one.labels != FALL
        pairs.append((one.keypoints[upright], other.keypoints[upright]))
    return compare(pairs)


def show(found: Statistics, console: Console) -> None:
    """Print what was found beside what `detector` uses."""
    table = Table(title=f"AlphaPose, MoveNet on {found.frames} frames (drawn by detector, left and right)")
    for column in ("keypoint", "spread [torso]", "misplaced", "exchanged", "faint"):
        table.add_column(column, justify="left" if column == "keypoint" else "right")
    for index in range(KEYPOINTS):
        pair = index // 2
        table.add_row(
            NAMES[index],
            f"{found.spread[index]:.3f} ({detector.SPREAD[pair]:.3f})",
            f"{found.misplaced[index]:.1%} ({detector.MISPLACED[pair]:.1%})",
            f"{found.swapped[pair]:.1%} ({detector.SWAPPED[pair]:.1%})",
            f"{found.faint[0, index]:.1%}, {found.faint[1, index]:.1%} ({detector.FAINT[pair]:.1%})",
        )
    console.print(table)
    console.print(
        f"from frame to frame {found.jitter[0]:.3f}, {found.jitter[1]:.3f} torso lengths "
        f"({detector.JITTER[0]:.3f} to {detector.JITTER[1]:.3f}); nobody found in {found.blind[0]:.1%}, "
        f"{found.blind[1]:.1%} of the frames ({detector.BLIND:.1%} of one)"
    )


def plain(found: Statistics) -> dict[str, Any]:
    """Return what was found by keypoint and by estimator, AlphaPose first, for JSON."""
    return {"keypoints": list(NAMES), "estimators": ["alphapose", "movenet"], **found._asdict()}


def _swapped(first: Floats, other: Floats) -> Floats:
    """Share of exchanged pairs (6,): the two fit better than half as far when left and right of one change places."""
    shares = []
    for left in range(0, KEYPOINTS, 2):
        right = left + 1
        apart = np.minimum(_distance(first, left, first, right), _distance(other, left, other, right)) > APART
        straight = _distance(first, left, other, left) + _distance(first, right, other, right)
        crossed = _distance(first, left, other, right) + _distance(first, right, other, left)
        exchanged = apart & (crossed < 0.5 * straight)
        shares.append(exchanged.sum() / apart.sum() if apart.any() else np.nan)
    return np.array(shares)


def _distance(a: Floats, i: int, b: Floats, j: int) -> Floats:
    distance: Floats = np.linalg.norm(a[:, i] - b[:, j], axis=-1)
    return distance


def _robust(values: Floats) -> Floats:
    """Robust standard deviation over the first axis."""
    deviation: Floats = _TO_SIGMA * np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    return deviation


def main(data: DataOption = None) -> None:
    """Measure again what the detector's noise is drawn from."""
    show(measure(data_folder(data)), result_console())


if __name__ == "__main__":
    typer.run(main)
