"""How the panels are laid out: Rerun calls it a blueprint; it travels with the stream and the file."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from bridge.view import control, health, horizon
from bridge.view.body import IMAGE
from bridge.view.canvas import TRIAL
from bridge.view.extra import Rerun
from bridge.view.geometry import Plane, around
from bridge.view.plane import PLANE, SEEN_SD
from bridge.view.walker import WORLD

PAPER: Final = (250, 250, 248)  # behind what is black and cyan
LIVE_WINDOW_S: Final = 20.0
PATH_S: Final = 20.0
MARGIN: Final = 0.06  # around the image


class Look(NamedTuple):
    """What the layout depends on."""

    plane: Plane
    image_size: tuple[int, int]  # width, height [px]
    length_s: float | None  # of the recording; None: live, which follows the newest and shows the last seconds


def layout(rerun: Rerun, look: Look) -> Any:
    """Return the blueprint: the person on the left, the trial's curves in the middle, the machine on the right."""
    rrb = rerun.blueprint
    live = look.length_s is None
    return rrb.Blueprint(
        rrb.Horizontal(_person(rerun, look), _trial(rerun, look), _machine(rerun, look), column_shares=[4, 5, 3.4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TRIAL, play_state="following" if live else "playing"),
        auto_layout=False,
        auto_views=False,
    )


def _person(rerun: Rerun, look: Look) -> Any:
    rrb = rerun.blueprint
    width, height = look.image_size
    edge = MARGIN * max(width, height)
    seen = around(look.plane, SEEN_SD)
    x, y = np.stack((seen.low, seen.high), axis=1).tolist()
    chart = [-horizon.ROOM, horizon.FULL + horizon.ROOM]
    return rrb.Vertical(
        rrb.Spatial2DView(
            origin=IMAGE,
            name="Person: now black, the next half second cyan",
            background=PAPER,
            visual_bounds=rrb.VisualBounds2D(x_range=[-edge, width + edge], y_range=[-edge, height + edge]),
        ),
        rrb.Horizontal(
            rrb.Spatial2DView(
                origin=PLANE,
                name="Transient plane [sd]",
                background=PAPER,
                visual_bounds=rrb.VisualBounds2D(x_range=x, y_range=y),
            ),
            rrb.Spatial2DView(
                origin=horizon.AHEAD,
                name="Probability ahead",
                background=PAPER,
                visual_bounds=rrb.VisualBounds2D(x_range=chart, y_range=chart),
            ),
        ),
        row_shares=[1.15, 1],
    )


def _trial(rerun: Rerun, look: Look) -> Any:
    rrb = rerun.blueprint
    plots = _Plots(rerun, look)
    velocities = [f"{control.VELOCITY}/{axis}/**" for axis in control.AXES]
    return rrb.Vertical(
        plots.states("Supervisor and control law", control.STATE),
        plots.curves(
            "Probability of stable, transient, fall; light: in 500 ms",
            [horizon.PROBABILITY],
            limits=(-0.03, 1.03),
            legend=False,
        ),
        plots.curves("Distance to the fall boundary [sd]; cyan: in 500 ms", [horizon.DISTANCE], legend=False),
        plots.curves("Stiffening, horizon quality", [control.STIFFENING, horizon.QUALITY], limits=(-0.03, 1.03)),
        rrb.Tabs(
            plots.curves("Forward [m/s]", velocities[:1]),
            plots.curves("Left [m/s]", velocities[1:2]),
            plots.curves("Yaw [rad/s]", velocities[2:3]),
            plots.curves("Height [m]", [control.HEIGHT_COMMAND, control.HEIGHT]),
            plots.curves("K", [control.STIFFNESS]),
            plots.curves("D", [control.DAMPING]),
            plots.curves("To boundary [s]", [horizon.TIME_LEFT]),
        ),
        rrb.Tabs(
            plots.curves("Force on the walker [N]", [control.FORCE]),
            plots.curves("Torque [N m]", [control.TORQUE]),
        ),
        row_shares=[1.2, 1.4, 1.4, 1.1, 1.3, 1.2],
    )


def _machine(rerun: Rerun, look: Look) -> Any:
    rrb = rerun.blueprint
    plots = _Plots(rerun, look)
    boundary = rerun.sdk.TimeRangeBoundary
    path = rerun.sdk.VisibleTimeRange(
        TRIAL, start=boundary.cursor_relative(seconds=-PATH_S), end=boundary.cursor_relative()
    )
    walker = rrb.Spatial3DView(
        origin=WORLD,
        name="Walker",
        background=PAPER,
        eye_controls=rrb.EyeControls3D(
            position=[-2.2, -1.8, 1.9], look_target=[0.0, 0.0, 0.5], tracking_entity=f"{WORLD}/walker/frame"
        ),
        time_ranges=[path],
    )
    return rrb.Vertical(
        rrb.Tabs(
            rrb.TextDocumentView(origin=health.SUMMARY, name="Processes"),
            plots.states("Since when", health.PROCESS),
        ),
        walker,
        rrb.Tabs(
            plots.curves("Age on arrival [ms]", [f"{health.ON_ARRIVAL}/**"]),
            plots.curves("Age of inputs [ms]", [f"{health.AGE}/**"]),
            plots.curves("Rates [Hz]", [f"{health.RATE}/**"]),
            plots.curves("Controller step [ms]", [control.SOLVE]),
        ),
        rrb.TextLogView(
            origin=health.EVENTS,
            name="Events",
            columns=rrb.archetypes.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
        ),
        row_shares=[1.1, 1.6, 1.2, 1.3],
    )


class _Plots:
    """Views over time that show the same stretch of it."""

    def __init__(self, rerun: Rerun, look: Look) -> None:
        self._rrb = rerun.blueprint
        boundary = rerun.sdk.TimeRangeBoundary
        if look.length_s is None:
            start, end = boundary.cursor_relative(seconds=-LIVE_WINDOW_S), boundary.cursor_relative()
            axis = self._rrb.TimeAxis(link="Independent")
        else:
            start, end = boundary.infinite(), boundary.infinite()
            whole = rerun.sdk.TimeRange(
                boundary.absolute(seconds=0.0), boundary.absolute(seconds=max(look.length_s, 1.0))
            )
            axis = self._rrb.TimeAxis(link="Independent", view_range=whole)
        self._ranges = [rerun.sdk.VisibleTimeRange(TRIAL, start=start, end=end)]
        self._axis = axis

    def curves(
        self, name: str, paths: list[str], *, limits: tuple[float, float] | None = None, legend: bool = True
    ) -> Any:
        rrb = self._rrb
        return rrb.TimeSeriesView(
            origin="/",
            contents=[f"+ /{path}" for path in paths],
            name=name,
            axis_x=self._axis,
            axis_y=None if limits is None else rrb.ScalarAxis(range=limits, zoom_lock=True),
            plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
            time_ranges=self._ranges,
        )

    def states(self, name: str, path: str) -> Any:
        return self._rrb.StateTimelineView(origin=path, name=name, time_view=self._axis, time_ranges=self._ranges)
