"""Each fall as a line: when it began, when the walker was alarmed, when the person lay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from anticipation.training.report.drawing import figure, plain
from bridge.colours import FALL, FORECAST, INK, TRANSIENT


def leads(events: Mapping[str, Any]) -> Figure:
    """Draw lead times of all falls, the earliest alarm on top."""
    falls = sorted(events["falls"], key=lambda fall: -np.inf if fall["first_alarm"] is None else fall["first_alarm"])
    drawn = figure(8.2, 1.1 + 0.19 * len(falls))
    axes = drawn.add_subplot()
    rows = np.arange(len(falls))
    axes.barh(rows, [-fall["onset"] for fall in falls], color=TRANSIENT, alpha=0.35, height=0.72, lw=0,
              label="data set's 'falling'")  # fmt: skip
    for kind, marker, colour, name in (
        ("physical_onset", "|", INK, "physical onset"),
        ("first_alarm", "o", FORECAST, "first GUARD or ARREST"),
        ("first_arrest", "D", FALL, "first ARREST"),
    ):
        there = [(-fall[kind], row) for row, fall in enumerate(falls) if fall[kind] is not None]
        if there:
            at, row_of = zip(*there, strict=True)
            axes.scatter(at, row_of, marker=marker, s=60 if marker == "|" else 22, color=colour, label=name, zorder=3)
    axes.axvline(0.0, color=FALL, lw=1.2)
    axes.set_yticks(rows, [_name(fall) for fall in falls], fontsize=7)
    axes.set_ylim(-0.7, len(falls) - 0.3)
    axes.set_xlim(None, 0.12)
    plain(axes, "", "time since the first lying frame [s]")
    axes.tick_params(axis="y", labelsize=7)
    axes.legend(fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, handletextpad=0.4)
    return drawn


def _name(fall: Mapping[str, Any]) -> str:
    return f"{fall['source']} {fall['name'].removesuffix('-cam1')}{'  (early)' if fall['early'] else ''}"
