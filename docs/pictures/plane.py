"""The transient plane with its regions, the fall boundary, and the way of the shipped fall through it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from paper import quiet, sheet
from trial import Trial

from anticipation.checkpoint import load
from bridge.colours import CLASS_COLOURS, FALL, FORECAST, INK, rgb
from bridge.messages import CLASSES
from bridge.view.geometry import around, fall_boundary, raster, region

MOMENTS_S: Final = (0.6, 0.8)  # horizons that are drawn, since the onset of the fall
SHOWN_S: Final = (-1.0, 1.6)  # the way that is drawn


def draw_plane(trial: Trial) -> Figure:
    """Return the picture."""
    plane = load().plane
    figure = sheet("The transient plane: where the gait is, and where it is going", 9.2, 6.6)
    axes: Any = figure.add_axes((0.08, 0.085, 0.89, 0.845))
    box = around(plane, 2.2)
    palette = np.array([rgb(colour) for colour in CLASS_COLOURS]) / 255
    extent = (box.low[0], box.high[0], box.low[1], box.high[1])
    axes.imshow(palette[raster(plane, box, 700)], extent=extent, origin="lower", alpha=0.16, aspect="equal")
    for side in fall_boundary(plane, box):
        axes.plot(*side.T, color=FALL, linewidth=2.2)
    for kind, name in enumerate(CLASSES):
        axes.plot(*plane.centres[kind], "*", color=CLASS_COLOURS[kind], markersize=15, markeredgecolor="white")
        corners = region(plane, kind, box)
        away = np.linalg.norm(corners - 0.5 * (box.low + box.high), axis=1)
        outer = 0.5 * corners.mean(0) + 0.5 * corners[away.argmax()]
        axes.text(*outer, name, fontsize=13, ha="center", color=CLASS_COLOURS[kind])
    inside = (trial.time_s >= SHOWN_S[0]) & (trial.time_s <= SHOWN_S[1])
    way = np.array([horizon.plane[0] for horizon in trial.horizons])[inside]
    axes.plot(*way.T, ".-", color=INK, linewidth=1.2, markersize=4, label="the present, every 33 ms")
    for number, moment in enumerate(MOMENTS_S):
        ahead = trial.horizons[trial.at(moment)].plane
        label = None if number else "the half second foreseen"
        axes.plot(*ahead.T, ".-", color=FORECAST, linewidth=2, markersize=5, label=label)
        axes.plot(*ahead[0], "o", color=INK, markersize=8)
        axes.annotate(
            f"{moment * 1e3:+.0f} ms", ahead[0], (8, 12), textcoords="offset points", fontsize=10,
            color=INK, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1},
        )  # fmt: skip
    axes.set_xlim(box.low[0], box.high[0])
    axes.set_ylim(box.low[1], box.high[1])
    axes.set_xlabel("first component [within-class standard deviations]; times since the fall's onset", fontsize=10)
    axes.set_ylabel("second component [within-class standard deviations]", fontsize=10)
    axes.legend(loc="lower right", fontsize=9)
    quiet(axes)
    return figure
