"""Where in a recording somebody falls: labels beside keypoints, or a list in CSV."""

from __future__ import annotations

import csv
import difflib
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from bridge.errors import SourceError
from bridge.messages import Floats
from controller.tuning.cases import OPEN, Case, Fall, Ints

FALLING: Final = 0
LYING: Final = 1
ONSET_S: Final = 1.0  # a fall without a known onset began so long before its impact
COLUMNS: Final = ("recording", "onset_s", "impact_s", "over_s")

Listed = Mapping[str, Sequence[Fall]]  # falls by name of the recording; an empty list says that there is none


def labelled_falls(label: Ints, times_s: Floats) -> tuple[Fall, ...]:
    """Return the falls that per-frame labels (N,) tell of: -1 upright, 0 falling, 1 lying.

    A fall is a stretch of lying that the recording does not begin with; it is over when the lying ends. A
    stretch of 0 that no lying follows is none.
    """
    edges = np.flatnonzero(np.diff(label)) + 1
    begins, ends = [0, *edges.tolist()], [*edges.tolist(), len(label)]
    falls: list[Fall] = []
    for index, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        if label[begin] != LYING or index == 0:
            continue
        impact_s = float(times_s[begin])
        falling = label[begins[index - 1]] == FALLING
        onset_s = float(times_s[begins[index - 1]]) if falling else max(impact_s - ONSET_S, 0.0)
        falls.append(Fall(onset_s, impact_s, float(times_s[end]) if end < len(label) else OPEN))
    return tuple(falls)


def read_falls(path: Path) -> dict[str, list[Fall]]:
    """Read a list of falls: CSV with the columns recording, onset_s, impact_s, over_s, one fall a row.

    Times are seconds from the recording's first message or frame. An empty onset is a second before the impact, an
    empty over_s the end of the recording; a row without any time says that nobody falls in that recording.

    Raises:
        SourceError: the file cannot be read, or a row does not make sense; names the line.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SourceError(f"{path}: cannot be read: {error}") from error
    header = [name.strip() for name in rows[0]] if rows else []
    if header[:3] != list(COLUMNS[:3]) or header[3:] not in ([], [COLUMNS[3]]):
        raise SourceError(f"{path}: the first line is '{','.join(header)}', expected '{','.join(COLUMNS)}'")
    falls: dict[str, list[Fall]] = {}
    for number, row in enumerate(rows[1:], start=2):
        cells = [cell.strip() for cell in row] + [""] * (len(COLUMNS) - len(row))
        if not any(cells) or cells[0].startswith("#"):
            continue
        if len(row) > len(COLUMNS) or not cells[0]:
            raise SourceError(f"{path}, line {number}: expected {','.join(COLUMNS)}")
        of = falls.setdefault(cells[0], [])
        if any(cells[1:]):
            of.append(_fall(cells, f"{path}, line {number}"))
    return falls


def with_falls(cases: Sequence[Case], listed: Listed, path: Path) -> list[Case]:
    """Return `cases` with the falls that `listed` tells of in place of their own.

    Raises:
        SourceError: a listed recording is none of the cases, or a fall lies beyond its end.
    """
    known = {name for case in cases for name in names_of(case)}
    for name in listed:
        if name not in known:
            nearest = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.0)
            raise SourceError(f"{path}: no recording '{name}' was given; the nearest is '{nearest[0]}'")
    told: list[Case] = []
    for case in cases:
        of = next((listed[name] for name in names_of(case) if name in listed), None)
        told.append(case if of is None else replace(case, falls=checked(case, of, path), labelled=True))
    return told


def names_of(case: Case) -> tuple[str, ...]:
    """Return the names that a list of falls may call a case by, the most particular first."""
    names = [case.name, case.group, case.name.rpartition(":")[2], case.group.rpartition(":")[2]]
    return tuple(dict.fromkeys(names))


def checked(case: Case, falls: Collection[Fall], where: Path) -> tuple[Fall, ...]:
    """Return `falls` in order.

    Raises:
        SourceError: one lies beyond the end of the case, or begins before the one before it is over.
    """
    ordered = sorted(falls)
    for fall in ordered:
        if fall.impact_s > case.duration_s:
            raise SourceError(
                f"{where}: {case.name}: impact at {fall.impact_s:g} s, the recording ends at {case.duration_s:.2f} s"
            )
    for fall, following in pairwise(ordered):
        if following.onset_s < fall.over_s:
            raise SourceError(
                f"{where}: {case.name}: a fall begins at {following.onset_s:g} s, before the one at "
                f"{fall.onset_s:g} s is over; give its over_s"
            )
    return tuple(ordered)


def _fall(cells: Sequence[str], where: str) -> Fall:
    times: list[float] = []
    for name, cell in zip(COLUMNS[1:], cells[1:], strict=True):
        try:
            value = float(cell) if cell else math.nan
        except ValueError:
            raise SourceError(f"{where}: {name} = {cell}: expected a number of seconds") from None
        if cell and not (math.isfinite(value) and value >= 0.0):
            raise SourceError(f"{where}: {name} = {cell}: expected seconds from the recording's start")
        times.append(value)
    onset_s, impact_s, over_s = times
    if math.isnan(impact_s):
        raise SourceError(f"{where}: impact_s is missing")
    onset_s = max(impact_s - ONSET_S, 0.0) if math.isnan(onset_s) else onset_s
    over_s = OPEN if math.isnan(over_s) else over_s
    if not onset_s < impact_s <= over_s:
        raise SourceError(f"{where}: expected onset_s < impact_s <= over_s, got {onset_s:g}, {impact_s:g}, {over_s:g}")
    return Fall(onset_s, impact_s, over_s)
