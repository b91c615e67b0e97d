"""The plane with its three regions and the way of one fall through it (the paper's Fig. 5), and all falls over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from anticipation.training.clips import FALL
from anticipation.training.evaluation.records import Predictions, Record
from anticipation.training.report.drawing import figure, plain
from anticipation.training.report.moments import half_a_second_before
from bridge.colours import CLASS_COLOURS, FAINT, FORECAST, INK
from bridge.messages import CLASSES, STEP_S

GRID: Final = 300
LAST_S: Final = 1.5  # before lying, over which distances are drawn
EVERY: Final = 3  # steps between two anticipated points that are marked


def plane(predictions: Predictions, falls: Sequence[Record]) -> Figure | None:
    """Draw the plane of one part, the present windows of its held-out falls, and the typical fall on its way.

    None if there is no fall whose last half second is known.
    """
    moment = half_a_second_before(falls)
    if moment is None:
        return None
    record, ticks, present = moment.record, moment.ticks, moment.present
    parameters = predictions.planes[record.part]
    mine = [each.ticks for each in falls if each.part == record.part and each.ticks is not None]
    points = np.concatenate([each.plane[each.valid, 0] for each in mine])
    labels = np.concatenate([each.labels[each.valid] for each in mine])
    drawn = figure(8.6, 5.0)
    axes = drawn.add_subplot()
    path = ticks.plane[max(0, present - 14) : present + 1, 0]
    path = path[np.isfinite(path).all(axis=1)]
    foreseen = ticks.plane[present]
    around = np.concatenate([np.percentile(points, [1, 99], axis=0), path, foreseen])
    low, high = around.min(axis=0) - 0.6, around.max(axis=0) + 0.6
    x, y = np.meshgrid(np.linspace(low[0], high[0], GRID), np.linspace(low[1], high[1], GRID))
    scores = np.stack([x, y], axis=-1) @ parameters["weights"].T + parameters["biases"]
    axes.pcolormesh(x, y, scores.argmax(axis=-1), cmap=ListedColormap(CLASS_COLOURS), alpha=0.22, lw=0, rasterized=True)
    for kind, name in enumerate(CLASSES):
        axes.plot(*points[labels == kind].T, ".", color=CLASS_COLOURS[kind], ms=3.0, alpha=0.55, label=name)
    axes.plot(*path.T, "-o", color=INK, ms=4, lw=1.2, label="present and the half second before")
    axes.plot(*foreseen.T, "-", color=FORECAST, lw=1.2)
    axes.plot(*foreseen[EVERY::EVERY].T, "o", color=FORECAST, ms=6, mec=INK, mew=0.5, label="anticipated, each 100 ms")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    title = f"{record.name} (held out), {(moment.lying - present) * STEP_S:.1f} s before lying"
    plain(axes, title, "first axis [within-class sd]", "second axis [within-class sd]")
    legend = axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    for handle in legend.legend_handles[: len(CLASSES)]:
        if isinstance(handle, Line2D):
            handle.set_markersize(7.0)
    return drawn


def approach(falls: Sequence[Record]) -> Figure:
    """Draw the distance to the fall boundary over the end of every held-out fall: seen, and foreseen by 500 ms."""
    drawn = figure(9.0, 3.6)
    left, right = drawn.subplots(1, 2, sharey=True)
    _distances(left, falls, 0, INK, "Present")
    _distances(right, falls, 15, FORECAST, "Foreseen 500 ms before")
    left.set_ylabel("distance to the fall boundary [sd]", fontsize=9)
    return drawn


def _distances(axes: Axes, falls: Sequence[Record], step: int, colour: str, title: str) -> None:
    grid = np.arange(-round(LAST_S / STEP_S), round(0.3 / STEP_S) + 1)
    rows = []
    for record in falls:
        ticks = record.ticks
        if ticks is None or not (ticks.labels == FALL).any():
            continue
        lying = np.flatnonzero(ticks.labels == FALL)
        at = int(lying[0]) + grid - step  # when it was said
        there = (at >= 0) & (at < len(ticks))
        row = np.full(len(grid), np.nan)
        row[there] = np.where(ticks.valid[at[there]], ticks.distance[at[there], step], np.nan)
        rows.append(row)
        axes.plot(grid * STEP_S, row, color=FAINT, lw=0.6)
    if rows:
        values = np.array(rows)
        there = np.isfinite(values).sum(axis=0) >= max(1, round(0.8 * len(rows)))
        middle = [float(np.nanmedian(column)) if ok else np.nan for column, ok in zip(values.T, there, strict=True)]
        axes.plot(grid * STEP_S, middle, color=colour, lw=2.4, label="median fall")
        axes.legend(fontsize=8, frameon=False, loc="upper right")
    axes.axhline(0.0, color=CLASS_COLOURS[FALL], lw=0.9)
    axes.axvline(0.0, color=CLASS_COLOURS[FALL], lw=0.9, ls=":")
    plain(axes, title, "time since the first lying frame [s]")
