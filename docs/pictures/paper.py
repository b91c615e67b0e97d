"""A sheet to draw on: quiet axes, one title, and a body of twelve points."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bridge.colours import INK
from perception.skeleton import LINKS


def sheet(title: str, width: float, height: float) -> Figure:
    """Return a figure with its title at the upper left; sizes in inches."""
    figure = Figure(figsize=(width, height))
    figure.suptitle(title, x=0.02, ha="left", y=1 - 0.12 / height, va="top", fontsize=13, fontweight="bold", color=INK)
    return figure


def quiet(axes: Any) -> None:
    """Leave only the axes that carry numbers."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9, colors=INK)


def bare(axes: Any) -> None:
    """Leave no axes at all."""
    axes.set_axis_off()
    axes.set_aspect("equal")


def body(axes: Any, points: np.ndarray, colour: str, alpha: float = 1.0, width: float = 2.0) -> None:
    """Draw the links of a body (12, 2), image y down."""
    for source, target in LINKS:
        axes.plot(*points[[source, target]].T, color=colour, alpha=alpha, linewidth=width, solid_capstyle="round")
    axes.plot(*points.T, "o", color=colour, alpha=alpha, markersize=1.8 * width)
