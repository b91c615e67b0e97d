"""A timeline as one picture: skeletons on top, below them panels that share the time axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from numpy.typing import NDArray

from bridge.colours import FAINT, FALL, FORECAST, INK, STABLE, STATE_COLOUR, TRANSIENT
from bridge.config.intervention import InterventionConfig
from bridge.launch.timeline import Row, Snapshot
from bridge.messages import Floats

LABEL_COLOUR: Final = {-1: STABLE, 0: TRANSIENT, 1: FALL}
LABEL_TEXT: Final = {-1: "walking", 0: "falling", 1: "lying"}
DOTS_PER_INCH: Final = 110
LEFT, RIGHT = 0.085, 0.915  # of the panels, in figure widths
COLOURS: Final = 255  # of the file's palette: a third of the size, and no difference to the eye


class Labels(NamedTuple):
    """What the recording says of itself."""

    time_s: Floats  # (N,) of each frame, since the first [s]
    label: NDArray[np.int8]  # (N,) -1 stable, 0 falling, 1 lying


class Picture(NamedTuple):
    """All that is drawn."""

    title: str
    rows: Sequence[Row]
    snapshots: Sequence[Snapshot]
    labels: Labels | None
    thresholds: InterventionConfig
    links: NDArray[np.int64]  # (L, 2) pairs of keypoints that a line joins


def write(picture: Picture, path: Path) -> None:
    """Write `picture` as a PNG, whole or not at all."""
    figure = draw(picture)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    from PIL import Image  # noqa: PLC0415 (comes with matplotlib; needed at the very end only)

    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(part, format="PNG", optimize=True)
    part.replace(path)


def draw(picture: Picture) -> Figure:
    """Return the figure."""
    figure = Figure(figsize=(11.5, 10.9), facecolor="white", dpi=DOTS_PER_INCH)
    figure.suptitle(picture.title, x=LEFT, ha="left", y=0.988, va="top", fontsize=13.5, fontweight="bold", color=INK)
    top = GridSpec(1, 1, figure, left=LEFT, right=RIGHT, top=0.915, bottom=0.775)
    grid = GridSpec(
        6, 1, figure, height_ratios=(0.5, 1.35, 1.2, 0.8, 1.1, 1.1), hspace=0.14,
        left=LEFT, right=RIGHT, top=0.755, bottom=0.048,
    )  # fmt: skip
    columns = _columns(picture.rows)
    end_s = float(columns["time_s"][-1]) if len(picture.rows) else 1.0
    band = figure.add_subplot(grid[0])
    panels = [figure.add_subplot(grid[index], sharex=band) for index in range(1, 6)]
    _draw_skeletons(figure, top[0], picture)
    _draw_states(band, panels, picture)
    _draw_probabilities(panels[0], columns)
    _draw_distance(panels[1], columns, picture.thresholds)
    _draw_stiffening(panels[2], columns)
    _draw_admittance(panels[3], columns)
    _draw_motion(panels[4], columns)
    band.set_xlim(0.0, end_s)
    for panel in (band, *panels):
        panel.tick_params(labelbottom=panel is panels[-1], labelsize=9, colors=INK)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
        panel.yaxis.set_label_coords(-0.055, 0.5)
    panels[-1].set_xlabel("time in the recording [s]", fontsize=10)
    return figure


def _columns(rows: Sequence[Row]) -> dict[str, Any]:
    return {name: np.array([getattr(row, name) for row in rows]) for name in Row._fields}


def _draw_skeletons(figure: Any, cell: Any, picture: Picture) -> None:
    count = max(len(picture.snapshots), 1)
    cells = cell.subgridspec(1, count, wspace=0.04)
    half = _half_size([points for shot in picture.snapshots for points in (shot.present_px, shot.later_px)])
    for index, shot in enumerate(picture.snapshots):
        axes = figure.add_subplot(cells[index])
        centre = _centre(shot)
        for points, colour, width, order in (
            (shot.later_px, FAINT, 1.3, 1),
            (shot.present_px, INK, 1.8, 2),
            (shot.forecast_px, FORECAST, 1.8, 3),
        ):
            _draw_skeleton(axes, points, picture.links, colour, width, order)
        axes.set_xlim(centre[0] - half, centre[0] + half)
        axes.set_ylim(centre[1] + 1.08 * half, centre[1] - 1.08 * half)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set_color("#dddddd")
        axes.set_title(f"{shot.time_s:.1f} s", fontsize=9.5, color=INK, pad=3)
    keys = (("now", INK), ("forecast for 500 ms later", FORECAST), ("what came 500 ms later", FAINT))
    for place, (text, colour) in zip((0.0, 0.05, 0.24), keys, strict=True):
        figure.text(LEFT + place, 0.943, text, color=colour, fontsize=10, va="bottom", fontweight="bold")


def _draw_skeleton(axes: Any, points: Floats, links: Any, colour: str, width: float, order: int) -> None:
    for source, target in links:
        axes.plot(*points[[source, target]].T, color=colour, linewidth=width, zorder=order, solid_capstyle="round")


def _half_size(skeletons: Sequence[Floats]) -> float:
    """Half of the window's width that holds every skeleton [px]."""
    spans = [np.nanmax(p, axis=0) - np.nanmin(p, axis=0) for p in skeletons if np.isfinite(p).any()]
    return 0.56 * max([2.0, *(float(span.max()) for span in spans)])


def _centre(shot: Snapshot) -> Floats:
    known = [p for p in (shot.present_px, shot.later_px, shot.forecast_px) if np.isfinite(p).any()]
    if not known:
        return np.zeros(2)
    together = np.concatenate(known)
    return np.asarray(0.5 * (np.nanmax(together, axis=0) + np.nanmin(together, axis=0)))


def _draw_states(band: Any, panels: Sequence[Any], picture: Picture) -> None:
    """Coloured runs of the supervisor's state, and above them the recording's own labels."""
    times = [row.time_s for row in picture.rows]
    for start, stop, state in _runs(times, [row.state for row in picture.rows]):
        if not state:
            continue
        colour = STATE_COLOUR.get(state, "#ffffff")
        band.axvspan(start, stop, 0.0, 0.56, facecolor=colour, edgecolor="white", linewidth=0.8)
        if stop - start > 0.11 * len(state) * (times[-1] / 14.0 if times else 1.0):
            band.text(
                0.5 * (start + stop), 0.26, state, ha="center", va="center", fontsize=8.5, color=INK, clip_on=True
            )
        if state != "FOLLOW":
            for panel in panels:
                panel.axvspan(start, stop, facecolor=colour, alpha=0.28, linewidth=0, zorder=0)
    if picture.labels is not None:
        labels = picture.labels
        for start, stop, label in _runs(labels.time_s.tolist(), labels.label.tolist()):
            colour = LABEL_COLOUR.get(int(label), FAINT)
            band.axvspan(start, stop, 0.66, 1.0, facecolor=colour, alpha=0.85, edgecolor="white", linewidth=0.8)
            text = LABEL_TEXT.get(int(label), str(label))
            band.text(
                0.5 * (start + stop), 0.82, text, ha="center", va="center", fontsize=8.5, color="white", clip_on=True
            )
            if int(label) >= 0:
                for panel in panels:
                    panel.axvline(start, color=colour, linewidth=1.1, linestyle=(0, (1, 1.5)), zorder=1)
    for shot in picture.snapshots:
        band.plot([shot.time_s], [1.12], marker="v", color=INK, markersize=5, clip_on=False)
    band.set_ylim(0.0, 1.0)
    band.set_yticks([0.26, 0.82], ["state", "label"])
    band.tick_params(axis="y", length=0)
    band.tick_params(axis="x", length=0)
    band.spines["left"].set_visible(False)
    band.spines["bottom"].set_visible(False)


def _draw_probabilities(axes: Any, columns: dict[str, Any]) -> None:
    for name, colour in (("stable", STABLE), ("transient", TRANSIENT), ("fall", FALL)):
        axes.fill_between(columns["time_s"], columns[name], color=colour, alpha=0.10, linewidth=0)
        axes.plot(columns["time_s"], columns[name], color=colour, linewidth=1.5, label=f"{name}")
        axes.plot(columns["time_s"], columns[f"{name}_ahead"], color=colour, linewidth=1.4, linestyle=(0, (2.2, 1.4)))
    axes.plot([], [], color=INK, linewidth=1.4, linestyle=(0, (2.2, 1.4)), label="in 500 ms")
    axes.set_ylim(-0.03, 1.30)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_ylabel("probability", fontsize=10)
    _legend(axes, columns=4)


def _draw_distance(axes: Any, columns: dict[str, Any], thresholds: InterventionConfig) -> None:
    axes.plot(columns["time_s"], columns["distance"], color=INK, linewidth=1.5, label="now")
    axes.plot(
        columns["time_s"], columns["distance_ahead"], color=FORECAST, linewidth=1.4, linestyle=(0, (2.2, 1.4)),
        label="in 500 ms",
    )  # fmt: skip
    for value, colour, text in (
        (thresholds.distance_onset_sd, TRANSIENT, "risk begins"),
        (thresholds.distance_full_sd, FALL, "full risk"),
    ):
        axes.axhline(value, color=colour, linewidth=0.9)
        axes.annotate(text, (1.005, value), xycoords=("axes fraction", "data"), fontsize=8, color=colour, va="center")
    axes.axhline(0.0, color=FAINT, linewidth=0.8, linestyle=":")
    axes.set_ylabel("distance to fall\nboundary [sd]", fontsize=10)
    _leave_room(axes)
    _legend(axes, columns=2)


def _draw_stiffening(axes: Any, columns: dict[str, Any]) -> None:
    axes.fill_between(columns["time_s"], columns["stiffening"], color="#6b4ba0", alpha=0.25, linewidth=0)
    axes.plot(columns["time_s"], columns["stiffening"], color="#6b4ba0", linewidth=1.5)
    axes.set_ylim(-0.03, 1.08)
    axes.set_ylabel("stiffening", fontsize=10)


def _draw_admittance(axes: Any, columns: dict[str, Any]) -> None:
    damping, stiffness = "#2b7a4b", "#8a5a20"
    axes.plot(columns["time_s"], columns["damping_x"], color=damping, linewidth=1.5)
    axes.set_ylabel("damping x\n[N s/m]", fontsize=10, color=damping)
    axes.set_ylim(bottom=0.0)
    twin = _twin(axes, stiffness)
    twin.plot(columns["time_s"], columns["stiffness_x"], color=stiffness, linewidth=1.5)
    twin.set_ylabel("stiffness x\n[N/m]", fontsize=10, color=stiffness)
    twin.set_ylim(0.0, _top(columns["stiffness_x"]))


def _draw_motion(axes: Any, columns: dict[str, Any]) -> None:
    height = "#2b7a4b"
    axes.plot(columns["time_s"], columns["command_x"], color=FORECAST, linewidth=2.2, label="base, commanded")
    axes.plot(columns["time_s"], columns["velocity_x"], color=INK, linewidth=1.1, label="base, measured")
    axes.axhline(0.0, color=FAINT, linewidth=0.8, linestyle=":")
    axes.set_ylabel("velocity x\n[m/s]", fontsize=10)
    _leave_room(axes)
    twin = _twin(axes, height)
    twin.plot(columns["time_s"], columns["height"], color=height, linewidth=1.4)
    twin.set_ylabel("column\nheight [m]", fontsize=10, color=height)
    known = columns["height"][np.isfinite(columns["height"])]
    if len(known):
        middle, span = 0.5 * (known.max() + known.min()), max(known.max() - known.min(), 0.1)
        twin.set_ylim(middle - span, middle + span)
    _legend(axes, columns=2)


def _twin(axes: Any, colour: str) -> Any:
    twin = axes.twinx()
    twin.tick_params(labelsize=9, colors=colour)
    twin.yaxis.set_label_coords(1.055, 0.5)
    for side in ("top", "left", "bottom"):
        twin.spines[side].set_visible(False)
    twin.spines["right"].set_color(colour)
    return twin


def _top(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return max(float(known.max()) * 1.08, 1.0) if len(known) else 1.0


def _leave_room(axes: Any) -> None:
    """Widen the range upwards, for the legend."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.22 * (high - low))


def _legend(axes: Any, columns: int) -> None:
    axes.legend(
        loc="upper left", ncols=columns, fontsize=8.5, frameon=True, framealpha=0.8, edgecolor="none", borderpad=0.2,
        handlelength=1.8, columnspacing=1.2,
    )  # fmt: skip


def _runs(times: Sequence[float], values: Sequence[Any]) -> list[tuple[float, float, Any]]:
    """Return start, end and value of each run of equal values; a run lasts until the next one begins."""
    runs: list[tuple[float, float, Any]] = []
    for time_s, value in zip(times, values, strict=True):
        if runs and runs[-1][2] == value:
            runs[-1] = (runs[-1][0], time_s, value)
            continue
        if runs:
            runs[-1] = (runs[-1][0], time_s, runs[-1][2])
        runs.append((time_s, time_s, value))
    return [run for run in runs if not math.isnan(run[0])]
