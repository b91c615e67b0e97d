"""The fall-state horizon: the half second ahead at one moment, and how it moves over the trial."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from bridge.colours import CLASS_COLOURS, FAINT, FALL, FORECAST, INK, TRANSIENT, rgb
from bridge.config.intervention import InterventionConfig
from bridge.messages import CLASSES, STEPS, FallHorizon
from bridge.view.canvas import Canvas

AHEAD: Final = "horizon"  # a chart in milliseconds to the right; probability 1 is 500 up
PROBABILITY: Final = "series/probability"
DISTANCE: Final = "series/distance"
TIME_LEFT: Final = "series/time_to_boundary"
QUALITY: Final = "series/quality"
FULL: Final = 500.0  # width [ms] and height of the chart
ROOM: Final = 90.0  # around it, for the numbers
_LIGHTER: Final = ("#8fbdea", "#f8c88e", "#ef9a95")  # the class colours, for what is 500 ms ahead
_NOWHERE: Final = math.nan


class HorizonPanel:
    """Draws the chart of the next half second, and curves of its two ends."""

    def __init__(self, canvas: Canvas, thresholds: InterventionConfig) -> None:
        self._canvas, self._thresholds = canvas, thresholds
        names = [f"{name} now" for name in CLASSES] + [f"{name} in 500 ms" for name in CLASSES]
        canvas.curves(PROBABILITY, names, (*CLASS_COLOURS, *_LIGHTER), (2.5, 2.5, 2.5, 1.5, 1.5, 1.5))
        canvas.curves(
            DISTANCE,
            ("now", "in 500 ms", "risk begins (config)", "full risk (config)"),
            ("#e8e8e8", FORECAST, TRANSIENT, FALL),
            (2.5, 1.5, 1.0, 1.0),
        )
        canvas.curves(TIME_LEFT, ("nearest over the horizon",), (FORECAST,), (2.0,))
        canvas.curves(QUALITY, ("horizon quality",), (FAINT,), (1.5,))
        self._axes()

    def horizon(self, horizon: FallHorizon) -> None:
        """Draw one horizon."""
        sdk, canvas = self._canvas.sdk, self._canvas
        ahead_ms = 1e3 * horizon.step_s * np.arange(STEPS)
        for name, colour, share in zip(CLASSES, CLASS_COLOURS, horizon.probabilities.T, strict=True):
            strip = np.column_stack((ahead_ms, FULL * (1.0 - share)))
            lines = sdk.LineStrips2D([strip], colors=rgb(colour), radii=sdk.Radius.ui_points(2.0))
            canvas.draw(f"{AHEAD}/{name}", lines)
        left_s = float(horizon.time_to_boundary.min())
        distance = float(horizon.distance[0]), float(horizon.distance[-1])
        thresholds = self._thresholds.distance_onset_sd, self._thresholds.distance_full_sd
        canvas.plot(PROBABILITY, (*horizon.probabilities[0], *horizon.probabilities[-1]))
        canvas.plot(DISTANCE, (*distance, *thresholds))
        canvas.plot(TIME_LEFT, (left_s if math.isfinite(left_s) else _NOWHERE,))
        canvas.plot(QUALITY, (horizon.quality,))

    def nothing(self, quality: float = math.nan) -> None:
        """Leave a gap: the horizon is invalid, with the quality that it says it has, or silent."""
        for name in CLASSES:
            self._canvas.clear(f"{AHEAD}/{name}")
        self._canvas.plot(PROBABILITY, (_NOWHERE,) * 6)
        self._canvas.plot(DISTANCE, (_NOWHERE,) * 4)
        self._canvas.plot(TIME_LEFT, (_NOWHERE,))
        self._canvas.plot(QUALITY, (quality,))

    def _axes(self) -> None:
        sdk, canvas = self._canvas.sdk, self._canvas
        grid = [[(x, 0.0), (x, FULL)] for x in np.linspace(0.0, FULL, 6)]
        grid += [[(0.0, y), (FULL, y)] for y in np.linspace(0.0, FULL, 5)]
        canvas.fix(
            f"{AHEAD}/axes/grid",
            sdk.LineStrips2D(grid, colors=[222, 222, 222], radii=sdk.Radius.ui_points(0.5), draw_order=-10.0),
        )
        below, left = FULL + 0.6 * ROOM, -0.5 * ROOM
        marks = {(0.0, below): "now", (0.5 * FULL, below): "250 ms", (FULL, below): "500 ms"}
        marks |= {(left, 0.0): "1", (left, 0.5 * FULL): "0.5", (left, FULL): "0"}
        places = np.array(list(marks))
        words = sdk.Points2D(
            places, labels=list(marks.values()), colors=rgb(INK), radii=sdk.Radius.ui_points(0.0), show_labels=True
        )
        canvas.fix(f"{AHEAD}/axes/marks", words)
