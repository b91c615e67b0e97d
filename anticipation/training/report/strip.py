"""Skeletons over time: what came, and what was foreseen of it (the paper's Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anticipation.training.evaluation.records import Record
from anticipation.training.report.drawing import figure
from anticipation.training.report.moments import Moment, half_a_second_before, well_before
from bridge.colours import FAINT, FORECAST, INK
from bridge.messages import STEP_S
from perception.skeleton import LINKS

SHOWN: Final = (-12, -8, -4, 0, 3, 6, 9, 12, 15)  # steps from the present


def strip(records: Sequence[Record]) -> Figure | None:
    """Draw a person of whom nothing is to be seen yet, and one half a second before lying: the typical ones.

    None if there is no such moment whose next half second is known.
    """
    found = [each for each in (well_before(records), half_a_second_before(records)) if each]
    if not found:
        return None
    drawn = figure(10.5, 2.9 * len(found))
    grid = drawn.subplots(2 * len(found), 1, squeeze=False)[:, 0]
    for index, moment in enumerate(found):
        _rows(grid[2 * index], grid[2 * index + 1], moment)
    return drawn


def _rows(above: Axes, below: Axes, moment: Moment) -> None:
    ticks, present = moment.ticks, moment.present
    shown = np.concatenate([ticks.poses[present + np.array(SHOWN)], ticks.forecast[present].astype(np.float32)])
    top, bottom = float(np.nanmin(shown[..., 1])) - 0.08, float(np.nanmax(shown[..., 1])) + 0.08
    zoom = min(1.0 / (bottom - top), 0.85 / max(0.1, float(np.nanmax(np.abs(shown[..., 0])))) / 2)
    for column, step in enumerate(SHOWN):
        truth = ticks.poses[present + step]
        _skeleton(above, truth, column, zoom, INK)
        if step > 0:
            _skeleton(below, truth, column, zoom, FAINT, faint=True)
            _skeleton(below, ticks.forecast[present, step - 1], column, zoom, FORECAST)
        name = "t" if step == 0 else f"t {'+' if step > 0 else '−'} {abs(round(step * STEP_S * 1000))} ms"
        above.annotate(name, (column, 1.0), (0, -2), xycoords=("data", "axes fraction"), textcoords="offset points",
                       ha="center", va="bottom", fontsize=8, color=INK)  # fmt: skip
    seconds = (moment.lying - present) * STEP_S
    above.set_title(
        f"{moment.record.name}, held out; t is {seconds:.1f} s before lying; mean keypoint error at 500 ms: "
        f"{moment.error:.2f} body lengths (the median fall)",
        fontsize=9, color=INK, loc="left", pad=16,
    )  # fmt: skip
    for axes, name in ((above, "what came"), (below, "foreseen at t")):
        axes.set_xlim(-0.75, len(SHOWN) - 0.4)
        axes.set_ylim(bottom * zoom, top * zoom)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.annotate(name, (-0.7, 0.5), xycoords=("data", "axes fraction"), rotation=90, ha="center", va="center",
                      fontsize=8.5, color=INK)  # fmt: skip
    below.annotate("made from the 15 frames up to t", (1.5, 0.5), xycoords=("data", "axes fraction"), ha="center",
                   va="center", fontsize=8, color=FAINT)  # fmt: skip


def _skeleton(
    axes: Axes, pose: NDArray[np.floating], column: int, zoom: float, colour: str, faint: bool = False
) -> None:
    points = np.asarray(pose, dtype=np.float64) * zoom + [column, 0.0]
    for start, end in LINKS:
        axes.plot(points[[start, end], 0], points[[start, end], 1], color=colour, lw=0.9 if faint else 1.7)
    if not faint:
        axes.plot(points[:, 0], points[:, 1], ".", color=colour, ms=3.5)
