"""Reliability: how often what was said with some confidence came true, before and after the temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from anticipation.training.report.drawing import figure, plain
from bridge.colours import FAINT, FORECAST, INK


def reliability(results: Mapping[str, Any]) -> Figure:
    """Draw a diagram for each horizon: area of a point after the number of predictions in its bin."""
    calibration = results["calibration"]
    horizons = list(calibration["reliability"])
    steps = {"0": 0} | {str(ms): index + 1 for index, ms in enumerate(results["error_horizons_ms"])}
    drawn = figure(4.2 * len(horizons), 3.9)
    for axes, horizon_ms in zip(drawn.subplots(1, len(horizons), squeeze=False)[0], horizons, strict=True):
        axes.plot([0.3, 1], [0.3, 1], color=FAINT, lw=1.0)
        for kind, colour, marker in (("before", INK, "o"), ("after", FORECAST, "s")):
            bins = calibration["reliability"][horizon_ms][kind]
            total = sum(count for count, _, _ in bins) or 1
            error = calibration[f"error_{kind}"][steps[horizon_ms]]
            axes.plot([each[1] for each in bins], [each[2] for each in bins], color=colour, lw=1.0)
            axes.scatter(
                [each[1] for each in bins], [each[2] for each in bins],
                s=[12 + 260 * each[0] / total for each in bins], color=colour, marker=marker, alpha=0.85, lw=0,
                label=f"{kind} (ECE {error:.3f})" if error is not None else kind,
            )  # fmt: skip
        plain(axes, f"{horizon_ms} ms ahead", "probability of the likeliest class", "share that came true")
        axes.set_xlim(0.3, 1.02)
        axes.set_ylim(0.0, 1.05)
        legend = axes.legend(fontsize=8, frameon=False, loc="lower right")
        for handle in legend.legend_handles:
            if handle is not None:
                handle.set_sizes([30.0])
    return drawn
