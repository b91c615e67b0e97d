"""The trade-off as an ECharts option: falls caught and lead time against needless interventions per hour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from controller.tuning.page.layout import NO_ANIMATION, axis, tooltip
from controller.tuning.page.palette import Palette

HEIGHT_PX: Final = 388
RECOMMENDED: Final = "recommended"


class Point(NamedTuple):
    """One setting of the thresholds."""

    name: str
    caught_share: float  # NaN where there is no fall
    lead_s: float  # NaN where none was caught
    per_hour: float  # NaN where there is no hour to count in
    outcome: str  # in words


def tradeoff_options(
    candidates: Sequence[Point], file: Point, now: Point, budget_per_h: float | None, palette: Palette
) -> dict[str, Any]:
    """Return the chart: the candidates of the study, the file's setting, and the one on the page.

    A click on a candidate comes back with its index as `dataIndex` in the series named 'candidates'.
    """
    everyone = [*candidates, file, now]
    most = max((point.per_hour for point in everyone if math.isfinite(point.per_hour)), default=0.0)
    right = max(1.0, 1.08 * most)
    leads = [point.lead_s for point in everyone if math.isfinite(point.lead_s)]
    low_s, high_s = min([0.0, *leads]), max([0.1, *leads])
    series: list[dict[str, Any]] = []
    for panel in (0, 1):
        series += [
            _dots("candidates", panel, candidates, 9, {"color": palette.stable, "opacity": 0.55}, 2),
            _dots("as in the file", panel, [file], 15, {**_ring(palette.ink), "opacity": 1.0}, 3, "diamond"),
            _dots("on this page", panel, [now], 15, {"color": palette.transient, "opacity": 1.0}, 4),
        ]
        if budget_per_h is not None:
            series[-3]["markLine"] = {
                "silent": True,
                "symbol": "none",
                "lineStyle": {"color": palette.quiet, "type": [5, 3]},
                "label": {
                    "show": panel == 0,
                    "formatter": f"budget {budget_per_h:g}/h",
                    "color": palette.quiet,
                    "position": "end",
                    "distance": 3,
                },
                "data": [{"xAxis": budget_per_h}],
            }
    return {
        **NO_ANIMATION,
        "textStyle": {"color": palette.ink},
        "tooltip": tooltip(palette, trigger="item", **{":formatter": "p => p.data.words"}),
        "legend": {"top": 0, "left": 0, "itemGap": 14, "textStyle": {"color": palette.ink, "fontSize": 11}},
        "grid": [
            {"left": 48, "right": 16, "top": 64, "height": 120, "outerBoundsMode": "none"},
            {"left": 48, "right": 16, "top": 220, "height": 120, "outerBoundsMode": "none"},
        ],
        "graphic": [
            _title("falls caught", 32, palette),
            _title("lead: intervention before the impact, median [s]", 200, palette),
        ],
        "xAxis": [
            axis(palette, type="value", gridIndex=0, min=0, max=right, axisLabel={"show": False}),
            axis(
                palette,
                type="value",
                gridIndex=1,
                min=0,
                max=right,
                name="needless interventions per hour",
                nameLocation="middle",
                nameGap=26,
                nameTextStyle={"color": palette.quiet, "fontSize": 12},
                **{"axisLabel": {"color": palette.quiet, "showMaxLabel": False}},
            ),
        ],
        "yAxis": [
            axis(
                palette,
                type="value",
                gridIndex=0,
                min=0,
                max=100,
                interval=25,
                axisLabel={"color": palette.quiet, "formatter": "{value} %"},
            ),
            axis(palette, type="value", gridIndex=1, min=_down(low_s), max=_up(high_s), splitNumber=4),
        ],
        "series": series,
    }


def _dots(
    name: str,
    panel: int,
    points: Sequence[Point],
    size: int,
    style: dict[str, Any],
    depth: int,
    symbol: str = "circle",
) -> dict[str, Any]:
    return {
        "type": "scatter",
        "name": name,
        "xAxisIndex": panel,
        "yAxisIndex": panel,
        "symbol": symbol,
        "symbolSize": size,
        "itemStyle": style,
        "z": depth,
        "data": [_datum(point, panel) for point in points],
    }


def _datum(point: Point, panel: int) -> dict[str, Any]:
    """Return a dot; what a study recommends is a triangle."""
    value = 100.0 * point.caught_share if panel == 0 else point.lead_s
    known = math.isfinite(value) and math.isfinite(point.per_hour)
    found = {"value": [point.per_hour, value] if known else ["-", "-"], "words": f"{point.name}<br>{point.outcome}"}
    return {**found, "symbol": "triangle", "symbolSize": 15} if point.name == RECOMMENDED else found


def _ring(colour: str) -> dict[str, Any]:
    return {"color": "transparent", "borderColor": colour, "borderWidth": 2.5}


def _title(text: str, top: int, palette: Palette) -> dict[str, Any]:
    return {
        "type": "text",
        "id": text,
        "left": 48,
        "top": top,
        "silent": True,
        "style": {"text": text, "fill": palette.quiet, "fontSize": 12},
    }


def _down(value: float) -> float:
    return math.floor(value * 5.0) / 5.0


def _up(value: float) -> float:
    return math.ceil(value * 5.0 + 1e-9) / 5.0
