"""What lies over and under the curves of a timeline: states, thresholds with their names, and the falls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.assess.spread import spread
from bridge.config.surefoot import SurefootConfig
from controller.tuning.page.layout import Layout
from controller.tuning.page.palette import Palette
from controller.tuning.page.trace import Band, bands
from controller.tuning.replay import STATES, Run

BAND, DISTANCE, PROBABILITY, RISK, STIFFENING = PANELS = range(5)
FAR_SD: Final = 15.0  # a threshold beyond this is switched off and not drawn
LABEL_PX: Final = 13.0
LETTER_PX: Final = 8.5
DASHES: Final = (5, 3)


class Threshold(NamedTuple):
    """A line across a panel."""

    key: str
    value: float
    colour: str


def thresholds(config: SurefootConfig, palette: Palette) -> dict[int, list[Threshold]]:
    """Return the thresholds that act in each panel."""
    intervention, supervisor = config.intervention, config.supervisor
    distances = [
        Threshold("distance_onset_sd", intervention.distance_onset_sd, palette.transient),
        Threshold("distance_full_sd", intervention.distance_full_sd, palette.fall),
        Threshold("approach_far_sd", intervention.approach_far_sd, palette.ahead),
        Threshold("approach_near_sd", intervention.approach_near_sd, palette.stable),
    ]
    return {
        DISTANCE: [line for line in distances if abs(line.value) < FAR_SD],
        PROBABILITY: [
            Threshold("probability_onset", intervention.probability_onset, palette.fall),
            Threshold("probability_full", intervention.probability_full, palette.fall),
            Threshold("credible_onset", intervention.credible_onset, palette.transient),
            Threshold("credible_full", intervention.credible_full, palette.transient),
        ],
        RISK: [
            Threshold("unconfirmed_most", intervention.unconfirmed_most, palette.transient),
            Threshold("guard_on", supervisor.guard_on, palette.ahead),
            Threshold("arrest_on", supervisor.arrest_on, palette.ink),
        ],
        STIFFENING: [
            Threshold("trusted_quality", intervention.trusted_quality, palette.quiet),
            Threshold("unknown_risk", intervention.unknown_risk, palette.stiffening),
        ],
    }


def marks(
    run: Run,
    lines: dict[int, list[Threshold]],
    ranges: Sequence[tuple[float, float, float]],
    palette: Palette,
    layout: Layout,
    touched: str,
) -> list[dict[str, Any]]:
    """Return one series without points for each panel, which carries its marks.

    Args:
        run: the recording.
        lines: the thresholds of each panel.
        ranges: least and largest value of each panel, and the step between.
        palette: the colours.
        layout: the measures.
        touched: key of the threshold to draw bold.
    """
    names = np.array([state.value for state in STATES])[run.state]
    found = bands(run.case.times_s, names)
    series = []
    for panel in PANELS:
        shown = [band for band in found if panel == BAND or band.state != "FOLLOW"]
        areas = [_area(band, panel, run.case.duration_s, palette, layout) for band in shown]
        across = _across(lines.get(panel, ()), ranges[panel][:2], palette, layout, touched)
        series.append(
            {
                "type": "line",
                "name": f"marks {panel}",
                "xAxisIndex": panel,
                "yAxisIndex": panel,
                "data": [],
                "z": 1,
                "markArea": {"silent": True, "data": areas},
                "markLine": {
                    "silent": True,
                    "symbol": "none",
                    "label": {"show": False},
                    "data": [*across, *_falls(run, panel, palette)],
                },
            }
        )
    return series


def _area(band: Band, panel: int, span_s: float, palette: Palette, layout: Layout) -> list[dict[str, Any]]:
    room_px = (band.end_s - band.start_s) / max(span_s, 1e-9) * layout.room_px
    label = {
        "show": panel == BAND and room_px > LETTER_PX * len(band.state),
        "color": palette.ink,
        "fontSize": 11,
        "position": "inside",
    }
    style = {"color": palette.states[band.state], "opacity": 1.0 if panel == BAND else 0.3}
    return [
        {"name": band.state, "xAxis": round(band.start_s, 3), "itemStyle": style, "label": label},
        {"xAxis": round(band.end_s, 3)},
    ]


def _across(
    lines: Sequence[Threshold], limits: tuple[float, float], palette: Palette, layout: Layout, touched: str
) -> list[dict[str, Any]]:
    """Return the thresholds of a panel with name and value at their ends, moved apart where they would overlap."""
    low, high = limits
    ordered = sorted(lines, key=lambda line: line.value)
    places = [(line.value - low) / (high - low) for line in ordered]
    apart = spread(places, LABEL_PX / layout.panel)
    return [
        {
            "yAxis": line.value,
            "lineStyle": {
                "color": line.colour,
                "type": DASHES,
                "width": 2.4 if line.key == touched else 1.0,
            },
            "label": {
                "show": layout.wide or line.key == touched,  # a phone has room for one
                "formatter": f"{line.key} {line.value:g}",
                "position": "end" if layout.wide else "insideEndTop",
                "offset": [0, (place - label) * layout.panel if layout.wide else 0],
                "color": line.colour,
                "backgroundColor": palette.card if not layout.wide else "transparent",
                "fontSize": 11,
                "fontWeight": "bold" if line.key == touched else "normal",
            },
        }
        for line, place, label in zip(ordered, places, apart, strict=True)
    ]


def _falls(run: Run, panel: int, palette: Palette) -> list[dict[str, Any]]:
    """Return where balance is lost and where the person lies, of each fall."""
    return [
        {
            "xAxis": round(time_s, 3),
            "lineStyle": {"color": palette.fall, "type": kind, "width": 1.6},
            "label": {
                "show": panel == BAND,
                "formatter": name,
                "position": "end",
                "align": side,
                "distance": 2,
                "color": palette.fall,
                "fontSize": 11,
            },
        }
        for fall in run.case.falls
        for time_s, kind, name, side in (
            (fall.onset_s, "dotted", "balance lost", "right"),
            (fall.impact_s, "solid", "impact", "left"),
        )
    ]
