"""The labels of one's own recordings: a CSV file, a line a clip."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from anticipation.training.clips import FALL, STABLE, TRANSIENT, UNLABELLED, Labels
from bridge.errors import SourceError
from bridge.messages import STEP_S

FALLING_S: Final = 1.0  # before lying: the second that the research data calls falling
COLUMNS: Final = ("clip", "onset_s", "lying_s")
OPTIONAL: Final = ("up_s", "person")


class Label(NamedTuple):
    """What the user says of a clip; times in seconds from its first frame."""

    onset_s: float | None
    lying_s: float | None
    up_s: float | None
    person: str


def read_labels(path: Path) -> dict[str, Label]:
    """Read the list of labels.

    Raises:
        SourceError: it is missing, has other columns, a time that is none, or a clip twice.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, strict=True))
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        raise SourceError(f"{path}: no list of labels ({error}); its first line is {','.join(COLUMNS)}") from error
    labels: dict[str, Label] = {}
    for number, row in enumerate(rows, start=2):
        if not set(COLUMNS) <= set(row) or not set(row) <= {*COLUMNS, *OPTIONAL}:
            found = ",".join(str(column) for column in row)
            raise SourceError(f"{path}: columns are {found}, expected {','.join(COLUMNS)} and perhaps up_s,person")
        where = f"{path}, line {number}"
        if row["clip"] in labels:
            raise SourceError(f"{where}: '{row['clip']}' was named before")
        onset, lying, up = (_time(where, column, row.get(column)) for column in ("onset_s", "lying_s", "up_s"))
        rising = [time for time in (onset, lying, up) if time is not None]
        if (onset is None) != (lying is None) or (lying is None and up is not None) or rising != sorted(set(rising)):
            raise SourceError(
                f"{where}: onset_s, lying_s and up_s must rise, and the first two be there or not together"
            )
        labels[row["clip"]] = Label(onset, lying, up, (row.get("person") or "").strip())
    return labels


def _time(where: str, column: str, text: str | None) -> float | None:
    if not (text or "").strip():
        return None
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not 0.0 <= value < np.inf:
        raise SourceError(f"{where}: {column} is '{text}', expected seconds from the clip's first frame")
    return value


def label_track(ticks: int, label: Label) -> Labels:
    """Label the 30 Hz ticks of a clip, (T,).

    Stable until the onset, falling for the last second before lying (not before the onset), a fall until the person
    is up. What lies between carries no label.
    """
    labels = np.full(ticks, STABLE, dtype=np.int64)
    if label.onset_s is None or label.lying_s is None:
        return labels
    time_s = np.arange(ticks) * STEP_S
    labels[time_s >= label.onset_s] = UNLABELLED
    labels[(time_s >= max(label.onset_s, label.lying_s - FALLING_S)) & (time_s < label.lying_s)] = TRANSIENT
    labels[time_s >= label.lying_s] = FALL
    if label.up_s is not None:
        labels[time_s >= label.up_s] = UNLABELLED
    return labels
