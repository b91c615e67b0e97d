"""Accuracy and forecast error over the horizon (the paper's Table 3 and Fig. 4 as curves)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anticipation.training.evaluation.examination import SHIFTED
from anticipation.training.evaluation.scores import CONSTANT, MAJORITY, SHIPPED, ZERO
from anticipation.training.report import paper
from anticipation.training.report.drawing import figure, plain
from bridge.colours import FAINT, FALL, FORECAST, INK, STABLE, TRANSIENT

_COLOUR: Final = {
    SHIPPED: FORECAST,
    SHIFTED: STABLE,
    f"{ZERO} + DGNN": TRANSIENT,
    f"{CONSTANT} + DGNN": FALL,
    ZERO: TRANSIENT,
    CONSTANT: FALL,
    MAJORITY: FAINT,
}


def accuracy(results: Mapping[str, Any], table: str = "urfd") -> Figure:
    """Draw accuracy over the horizon: mean and spread of the parts, beside the paper's own numbers."""
    drawn = figure(7.2, 4.0)
    axes = drawn.add_subplot()
    _curves(axes, results["horizons_ms"], results["tables"][table]["accuracy"])
    for (name, values), style in zip(list(paper.ACCURACY.items())[:2], (":", "--"), strict=True):
        axes.plot(
            paper.HORIZONS_MS,
            np.array(values, dtype=np.float64),
            style,
            color=INK,
            lw=1.1,
            label=f"paper, its protocol: {name}",
        )
    plain(axes, f"Accuracy of three classes, {results['protocol']} protocol", "anticipated time [ms]", "accuracy")
    axes.set_ylim(0.35, 1.0)
    axes.legend(fontsize=7.5, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn


def error(results: Mapping[str, Any]) -> Figure:
    """Draw the forecast error over the horizon: over all frames, and while the person falls."""
    drawn = figure(9.0, 3.8)
    left, right = drawn.subplots(1, 2, sharey=True)
    errors, horizons = results["forecast_error"], results["error_horizons_ms"]
    for axes, kind, title in ((left, "all_body", "All frames"), (right, "falling_body", "While falling")):
        _curves(axes, [0, *horizons], {name: _from_zero(parts) for name, parts in errors[kind].items()})
        plain(axes, title, "anticipated time [ms]", "mean keypoint error [body lengths]" if axes is left else "")
    left.errorbar(
        paper.HORIZONS_MS, paper.ERROR, paper.ERROR_SPREAD, fmt="--", color=INK, lw=1.1, capsize=2,
        label="paper, its protocol\n(normalisation not said)",
    )  # fmt: skip
    left.set_ylim(0.0, None)
    left.legend(fontsize=7.5, frameon=False, loc="upper left")
    return drawn


def _from_zero(parts: Sequence[Sequence[float | None]]) -> list[list[float | None]]:
    """Put the present in front, where nothing is foreseen yet."""
    return [[0.0, *part] for part in parts]


def _curves(axes: Axes, at: Sequence[float], rows: Mapping[str, Any]) -> None:
    for name, parts in rows.items():
        values = np.array(parts, dtype=np.float64)
        mean, spread = np.nanmean(values, axis=0), np.nanstd(values, axis=0)
        colour = _COLOUR.get(name, INK)
        axes.plot(at, mean, color=colour, lw=2.2 if name == SHIPPED else 1.2, label=name)
        if len(values) > 1 and name == SHIPPED:
            axes.fill_between(at, mean - spread, mean + spread, color=colour, alpha=0.22, lw=0, label="± sd over parts")
