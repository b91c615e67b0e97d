"""Experiments that others ran: a curve over what was varied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from anticipation.training.report.drawing import figure, plain
from bridge.colours import FALL, FORECAST, INK, STABLE, TRANSIENT


def curve(experiment: Mapping[str, Any]) -> Figure:
    """Draw each row of an experiment over its `x`."""
    drawn = figure(6.4, 3.6)
    axes = drawn.add_subplot()
    colours = (FORECAST, STABLE, TRANSIENT, FALL, INK)
    for number, row in enumerate(experiment["rows"]):
        values = np.array(row["values"], dtype=np.float64)
        spread = np.array(row.get("spread") or np.zeros(len(values)), dtype=np.float64)
        axes.errorbar(
            experiment["x"], values, spread, fmt="-o", ms=4, capsize=2, color=colours[number % 5], label=row["name"]
        )
    plain(axes, experiment["title"], experiment.get("x_name", ""), experiment.get("unit", ""))
    axes.legend(fontsize=8, frameon=False)
    return drawn
