"""The skeleton and the directed graph that the classifier sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from paper import bare, sheet

from anticipation.gait_state import incidence
from bridge.colours import FALL, INK, STABLE
from perception.skeleton import LINKS, NAMES

POSE = np.array(  # a person in the image, facing the camera [any unit]
    [
        [(0.70, 0.0), (0.0, 0.0), (1.0, 0.5), (-0.30, 0.5), (1.2, 1.0), (-0.5, 1.0)],
        [(0.6, 1.15), (0.1, 1.15), (0.66, 1.9), (0.04, 1.9), (0.7, 2.65), (0.0, 2.65)],
    ]
).reshape(12, 2)


def draw_skeleton() -> Figure:
    """Return the picture."""
    figure = sheet("Twelve keypoints, twelve directed links", 11, 4.9)
    grid = figure.add_gridspec(
        1, 3, width_ratios=(1.05, 1, 1), left=0.02, right=0.98, top=0.88, bottom=0.11, wspace=0.25
    )
    _graph(figure.add_subplot(grid[0]))
    source, target = incidence(LINKS)
    for column, matrix, name in ((1, source, "source"), (2, target, "target")):
        _matrix(figure.add_subplot(grid[column]), matrix.numpy(), name)
    return figure


def _graph(axes: Any) -> None:
    bare(axes)
    for number, (source, target) in enumerate(LINKS):
        a, b = POSE[source], POSE[target]
        arrow = {"arrowstyle": "-|>", "color": STABLE, "lw": 2, "shrinkA": 6, "shrinkB": 6, "mutation_scale": 15}
        axes.annotate("", b, a, arrowprops=arrow)
        axes.annotate(
            str(number), 0.5 * (a + b), fontsize=8.5, color="white", ha="center", va="center",
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": STABLE, "edgecolor": "white"},
        )  # fmt: skip
    axes.plot(*POSE.T, "o", color=INK, markersize=9)
    for vertex, (name, point) in enumerate(zip(NAMES, POSE, strict=True)):
        right = name.startswith("l_")  # the person faces us: their left is on the right
        below = -9 if "hip" in name else 0  # out of the wrists' way
        offset, side = ((9, below), "left") if right else ((-9, below), "right")
        axes.annotate(
            f"{vertex}  {name}" if right else f"{name}  {vertex}", point, offset,
            textcoords="offset points", ha=side, va="center", fontsize=9, color=INK,
        )  # fmt: skip
    axes.invert_yaxis()
    axes.set_xlim(-1.45, 2.15)


def _matrix(axes: Any, matrix: np.ndarray, name: str) -> None:
    axes.imshow(matrix, cmap="Blues", vmin=0, vmax=1.3)
    for vertex, link in np.argwhere(matrix > 0):
        axes.text(link, vertex, "1", ha="center", va="center", fontsize=8, color="white")
    axes.set_title(f"{name} incidence", fontsize=10.5, color=FALL if name == "target" else STABLE)
    axes.set_xticks(range(12))
    axes.set_yticks(range(12))
    axes.set_xlabel("link", fontsize=9)
    axes.set_ylabel("vertex", fontsize=9)
    axes.tick_params(labelsize=8, length=0)
