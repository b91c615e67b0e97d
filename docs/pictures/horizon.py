"""One fall-state horizon: what is foreseen at one moment of the fall, and what it is classified as."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from paper import body, quiet, sheet
from trial import Trial

from bridge.colours import CLASS_COLOURS, FALL, FORECAST, INK
from bridge.messages import CLASSES, FallHorizon

MOMENT_S: Final = 0.75  # after the onset of the fall
SHOWN: Final = (0, 3, 6, 9, 12, 15)  # steps drawn as bodies
SPACING: Final = 0.85  # body heights between two of them


def draw_horizon(trial: Trial) -> Figure:
    """Return the picture."""
    horizon = trial.horizons[trial.at(MOMENT_S)]
    figure = sheet(f"A fall-state horizon, {1e3 * MOMENT_S:.0f} ms after the onset of a fall", 10.5, 7.6)
    grid = figure.add_gridspec(
        3, 1, height_ratios=(1.3, 1, 1), left=0.09, right=0.97, top=0.92, bottom=0.075, hspace=0.16
    )
    bodies, probability, distance = (figure.add_subplot(grid[row]) for row in range(3))
    ahead = np.arange(len(horizon.distance)) * horizon.step_s * 1e3
    _bodies(bodies, horizon)
    probability.stackplot(ahead, horizon.probabilities.T, colors=CLASS_COLOURS, alpha=0.85, labels=CLASSES)
    probability.set_ylim(0, 1)
    probability.set_ylabel("probability", fontsize=10)
    probability.legend(loc="upper left", fontsize=9, ncols=3, framealpha=0.9)
    distance.axhspan(min(-1.0, horizon.distance.min() - 0.5), 0, color=FALL, alpha=0.12)
    distance.axhline(0, color=FALL, linewidth=1.4)
    distance.plot(ahead, horizon.distance, "o-", color=FORECAST, linewidth=2, markersize=4)
    distance.plot(0, horizon.distance[0], "o", color=INK, markersize=8)
    distance.set_ylabel("distance to the\nfall boundary [sd]", fontsize=10)
    distance.set_xlabel("ahead of the newest frame [ms]", fontsize=10)
    for axes in (probability, distance):
        quiet(axes)
        axes.set_xlim(0, 500)
    probability.tick_params(labelbottom=False)
    return figure


def _bodies(axes: Any, horizon: FallHorizon) -> None:
    height = np.ptp(horizon.forecast_px[0][:, 1])
    for place, step in enumerate(SHOWN):
        points = horizon.forecast_px[step] + [SPACING * height * place, 0]
        for earlier in SHOWN[:place][-1:]:
            body(axes, horizon.forecast_px[earlier] + [SPACING * height * place, 0], INK, 0.12, 1.6)
        body(axes, points, INK if step == 0 else FORECAST, 1.0, 2.4)
        likely = int(horizon.probabilities[step].argmax())
        axes.text(
            points[:, 0].mean(), points[:, 1].min() - 0.12 * height,
            f"{'now' if step == 0 else f'+{step * horizon.step_s * 1e3:.0f} ms'}: {CLASSES[likely]}",
            ha="center", fontsize=10, color=CLASS_COLOURS[likely],
        )  # fmt: skip
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.invert_yaxis()
