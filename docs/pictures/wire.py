"""Processes and streams, from the topic table and the table of who reads what."""

from __future__ import annotations

from typing import Any, Final

from matplotlib.figure import Figure
from paper import bare, sheet

from bridge.colours import FORECAST, INK, STABLE
from bridge.record.roles import INPUTS
from bridge.topics import TOPICS

HEAD: Final = {"arrowstyle": "-|>", "mutation_scale": 15}
ROLES: Final = {"perception": 0.0, "anticipation": 3.4, "controller": 6.8, "drive": 10.2}
SAYS: Final = {
    "perception": "camera to\n12 clean keypoints", "anticipation": "window to\nfall-state horizon",
    "controller": "horizon and wrench\nto motion", "drive": "the walker, or\na world to fall in",
}  # fmt: skip


def draw_wire() -> Figure:
    """Return the picture: one line for each stream, from its publisher to its readers."""
    figure = sheet("The wire: who publishes, who reads, how often, how old it may get", 11, 6.0)
    axes: Any = figure.add_axes((0.01, 0.01, 0.98, 0.9))
    bare(axes)
    for role, x in ROLES.items():
        axes.text(x, 1.0, role, fontsize=13, fontweight="bold", ha="center", va="center", color=INK)
        axes.text(x, 0.5, SAYS[role], fontsize=9, ha="center", va="center", color="#555555", linespacing=1.15)
        axes.plot([x, x], [0.1, -0.72 * len(TOPICS)], color="#bbbbbb", linewidth=5, solid_capstyle="round", zorder=0)
    for row, topic in enumerate(TOPICS):
        y = -0.72 * row - 0.35
        readers = [role for role, read in INPUTS.items() if topic in read]
        if topic.key == "detections":
            readers = ["perception"]  # where its source is the wire
        everybody = topic.publisher == "*"
        sources = list(ROLES) if everybody else [topic.publisher]
        for role in sources:
            axes.plot(ROLES[role], y, "o", color=STABLE, markersize=9)
        for reader in readers:
            axes.annotate(
                "", (ROLES[reader], y), (ROLES[sources[0]], y),
                arrowprops={**HEAD, "color": STABLE, "lw": 2, "shrinkA": 4, "shrinkB": 3},
            )  # fmt: skip
        if not readers:
            axes.annotate(
                "", (12.4, y), (ROLES[sources[-1]], y),
                arrowprops={**HEAD, "color": FORECAST, "lw": 1.6, "linestyle": (0, (3, 2))},
            )  # fmt: skip
            listener = "whoever\nlistens" if everybody else "a ROS 2\nbase"
            axes.text(12.5, y, listener, fontsize=8.5, va="center", color="#555555")
        ends = [ROLES[sources[-1]], *(ROLES[reader] for reader in readers)] if readers else [ROLES[sources[-1]], 12.4]
        middle = 0.5 * (ends[0] + ends[-1]) if not everybody else 0.5 * (ROLES["perception"] + ROLES["anticipation"])
        axes.text(
            middle, y + 0.17, f"{topic.key}   {topic.rate_hz:g} Hz, at most {topic.max_age_s * 1e3:g} ms old",
            fontsize=9, ha="center", va="bottom", color=INK,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85},
        )  # fmt: skip
    axes.set_xlim(-1.6, 13.6)
    axes.set_ylim(-0.72 * len(TOPICS) - 0.2, 1.5)
    axes.set_aspect("auto")
    return figure
