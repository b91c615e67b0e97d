"""Confusion matrices: what was true, what was said."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from anticipation.training.report.drawing import figure, plain
from bridge.colours import INK, STABLE
from bridge.messages import CLASSES


def confusion(table: Mapping[str, Any]) -> Figure:
    """Draw a matrix for each horizon of a table: share of each true class, and counts."""
    drawn = figure(3.6 * len(table["confusion"]), 3.4)
    shades = LinearSegmentedColormap.from_list("shades", ["white", STABLE])
    panels = drawn.subplots(1, len(table["confusion"]), squeeze=False)[0]
    for axes, (horizon_ms, counts) in zip(panels, table["confusion"].items(), strict=True):
        matrix = np.array(counts, dtype=np.float64)
        share = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1.0)
        axes.imshow(share, cmap=shades, vmin=0.0, vmax=1.0)
        for row, column in np.ndindex(matrix.shape):
            colour = "white" if share[row, column] > 0.6 else INK
            text = f"{share[row, column]:.0%}\n{int(matrix[row, column])}"
            axes.text(column, row, text, ha="center", va="center", fontsize=8.5, color=colour)
        plain(axes, f"{horizon_ms} ms ahead", "said", "true")
        axes.set_xticks(range(len(CLASSES)), CLASSES)
        axes.set_yticks(range(len(CLASSES)), CLASSES, rotation=90, va="center")
        axes.spines[:].set_visible(False)
    return drawn
