"""The timeline of one recording as an ECharts option: states, distance, probability, risk, stiffening.

The panels and colours are those of `surefoot assess --plot`, so that docs/tuning.md reads on both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.messages import Floats
from controller.tuning.page.layout import NO_ANIMATION, Layout, axis, tooltip
from controller.tuning.page.palette import Palette
from controller.tuning.page.timeline_marks import (
    BAND,
    DASHES,
    DISTANCE,
    PANELS,
    PROBABILITY,
    RISK,
    STIFFENING,
    Threshold,
    marks,
    thresholds,
)  # fmt: skip
from controller.tuning.page.trace import thin
from controller.tuning.replay import Run

TITLES: Final = {
    DISTANCE: "distance to fall boundary [sd]",
    PROBABILITY: "probability",
    RISK: "risk",
    STIFFENING: "stiffening, quality",
}


READING: Final = """points => {
  const known = points.filter(p => p.value[1] != null).sort((a, b) => a.seriesIndex - b.seriesIndex);
  const lines = known.map(p => p.marker + p.seriesName + ' <b>' + (+p.value[1]).toFixed(2) + '</b>');
  return '<div style="font-size: 11px; line-height: 1.35">'
    + ['<b>' + (+points[0].axisValue).toFixed(2) + ' s</b>', ...lines].join('<br>') + '</div>';
}"""


class Curve(NamedTuple):
    """One quantity over time."""

    name: str
    panel: int
    time_s: Floats  # (N,)
    value: Floats  # (N,), NaN where unknown
    colour: str
    dashed: bool = False  # of the future
    filled: bool = False


class Range(NamedTuple):
    """Of a vertical axis."""

    low: float
    high: float
    step: float  # between two lines of the grid


def timeline_options(
    run: Run, config: SurefootConfig, palette: Palette, layout: Layout, touched: str
) -> dict[str, Any]:
    """Return the chart of `run`.

    Args:
        run: the recording under the thresholds of `config`.
        config: whose thresholds are drawn in.
        palette: the colours.
        layout: the measures.
        touched: key of the threshold that was moved last, drawn bold; '' for none.
    """
    lines = thresholds(config, palette)
    ranges = _ranges(run, lines[DISTANCE])
    shown = curves(run, config.supervisor.horizon_age_limit_s, palette)
    return {
        **NO_ANIMATION,
        "textStyle": {"color": palette.ink},
        "axisPointer": {"link": [{"xAxisIndex": "all"}], "lineStyle": {"color": palette.quiet}},
        "tooltip": tooltip(palette, trigger="axis", padding=[6, 9], **{":formatter": READING}),
        "grid": [
            {
                "left": layout.left,
                "right": layout.right,
                "top": layout.top(panel),
                "height": layout.height(panel),
                "outerBoundsMode": "none",  # all panels keep one width, or their times do not lie above each other
            }
            for panel in PANELS
        ],
        "xAxis": [_time_axis(run, panel, palette) for panel in PANELS],
        "yAxis": [_value_axis(panel, ranges[panel], palette) for panel in PANELS],
        "dataZoom": [_zoom(palette, layout)],
        "series": [*map(_series, shown), *marks(run, lines, ranges, palette, layout, touched)],
        "graphic": [_title(panel, shown, palette, layout) for panel in TITLES],
    }


def curves(run: Run, age_limit_s: float, palette: Palette) -> list[Curve]:
    """Return what is drawn: what was foreseen at its arrival, what was made of it at each turn of the controller."""
    horizons, times_s = run.case.horizons, run.times_s
    at_s = (horizons.stream.arrival_ns - run.case.start_ns) / NS
    good = _usable(run)
    gap, quality = np.where(good, 0.0, np.nan), np.where(good, horizons.quality, 0.0)
    fall, not_stable = horizons.probabilities[:, :, 2], 1.0 - horizons.probabilities[:, :, 0]
    return [
        Curve("now", DISTANCE, at_s, horizons.distance[:, 0] + gap, palette.ink),
        Curve("in 500 ms", DISTANCE, at_s, horizons.distance[:, -1] + gap, palette.ahead, dashed=True),
        Curve("not stable, now", PROBABILITY, at_s, not_stable[:, 0] + gap, palette.transient),
        Curve("fall, now", PROBABILITY, at_s, fall[:, 0] + gap, palette.fall),
        Curve("fall, in 500 ms", PROBABILITY, at_s, fall[:, -1] + gap, palette.fall, dashed=True),
        Curve("largest ahead", RISK, times_s, run.risk_ahead, palette.ahead, dashed=True),
        Curve("within reach of ARREST", RISK, times_s, run.risk_near, palette.ink),
        Curve("stiffening", STIFFENING, times_s, run.stiffening, palette.stiffening, filled=True),
        Curve("quality", STIFFENING, times_s, _held(at_s, quality, times_s, age_limit_s), palette.quiet),
    ]


def _held(at_s: Floats, value: Floats, times_s: Floats, limit_s: float) -> Floats:
    """Return at `times_s` what came last in `value` at `at_s`; NaN before the first, and past the limit of age."""
    newest = np.searchsorted(at_s, times_s, side="right") - 1
    if not len(at_s):
        return np.full(len(times_s), np.nan)
    return np.where((newest >= 0) & (times_s - at_s[newest] <= limit_s), value[newest], np.nan)


def _usable(run: Run) -> NDArray[np.bool_]:
    return np.array([fault == "" for fault in run.case.horizons.stream.faults], np.bool_)


def _ranges(run: Run, lines: Sequence[Threshold]) -> list[Range]:
    distance = run.case.horizons.distance[_usable(run)][:, [0, -1]]
    values = [*distance[np.isfinite(distance)].tolist(), *(line.value for line in lines), 0.0]
    low, high = min(values), max(values)
    step = 1.0 if high - low <= 4.0 else 2.0 if high - low <= 9.0 else 5.0
    distances = Range(step * math.floor(low / step), step * math.ceil((high + 0.1) / step), step)
    return [distances if panel == DISTANCE else Range(0.0, 1.0, 0.25) for panel in PANELS]


def _time_axis(run: Run, panel: int, palette: Palette) -> dict[str, Any]:
    last = panel == PANELS[-1]
    found = axis(palette, type="value", gridIndex=panel, min=0, max=round(run.case.duration_s, 3))
    found["splitLine"] = {"show": False}
    found["axisLabel"] |= {"show": last, ":formatter": "v => +v.toFixed(1) + ' s'"}
    found["axisLine"] |= {"show": panel != BAND, "onZero": False}
    found["axisPointer"] = {"label": {"show": last, ":formatter": "p => (+p.value).toFixed(2) + ' s'"}}
    return found


def _value_axis(panel: int, span: Range, palette: Palette) -> dict[str, Any]:
    found = axis(palette, type="value", gridIndex=panel, min=span.low, max=span.high, interval=span.step)
    return {**found, "show": panel != BAND, "axisLine": {"show": False}, "axisPointer": {"show": False}}


def _zoom(palette: Palette, layout: Layout) -> dict[str, Any]:
    return {
        "type": "slider",
        "xAxisIndex": list(PANELS),
        "left": layout.left,
        "right": layout.right,
        "bottom": 6,
        "height": 22,
        "showDetail": False,
        "brushSelect": False,
        "filterMode": "none",
        "borderColor": palette.grid,
        "fillerColor": f"{palette.stable}33",
        "showDataShadow": False,
    }


def _series(curve: Curve) -> dict[str, Any]:
    found: dict[str, Any] = {
        "type": "line",
        "name": f"{TITLES[curve.panel].split(' ')[0].rstrip(',')}, {curve.name}"
        if curve.panel in (DISTANCE, RISK)
        else curve.name,
        "xAxisIndex": curve.panel,
        "yAxisIndex": curve.panel,
        "data": thin(curve.time_s, curve.value),
        "showSymbol": False,
        "emphasis": {"disabled": True},
        "z": 3,
        "lineStyle": {"color": curve.colour, "width": 1.6, "type": DASHES if curve.dashed else "solid"},
        "itemStyle": {"color": curve.colour},
    }
    if curve.filled:
        found["areaStyle"] = {"color": curve.colour, "opacity": 0.18}
    return found


def _title(panel: int, shown: Sequence[Curve], palette: Palette, layout: Layout) -> dict[str, Any]:
    """Return the name of a panel with its legend in the curves' colours."""
    here = [curve for curve in shown if curve.panel == panel]
    legend = "".join(f"   {{c{index}|{'┅' if curve.dashed else '━'} {curve.name}}}" for index, curve in enumerate(here))
    return {
        "type": "text",
        "id": f"title {panel}",
        "left": layout.left if layout.wide else 4,
        "top": layout.top(panel) - 18,
        "silent": True,
        "style": {
            "text": f"{{t|{TITLES[panel]}}}{legend}",
            "rich": {
                "t": {"fill": palette.ink, "fontSize": 12 if layout.wide else 10, "fontWeight": "bold"},
                **{
                    f"c{index}": {"fill": curve.colour, "fontSize": 11 if layout.wide else 9}
                    for index, curve in enumerate(here)
                },
            },
        },
    }
