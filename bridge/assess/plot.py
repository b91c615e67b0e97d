"""One picture per clip: what was foreseen, what was made of it, and every threshold between the two."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.assess.run import Assessment
from bridge.assess.spread import spread
from bridge.colours import FAINT, FALL, INK, STABLE, STATE_COLOUR, TRANSIENT
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from bridge.messages import STEP_S, Floats

AHEAD: Final = "#00868b"
VIOLET: Final = "#6b4ba0"
DASHED: Final = (0, (2.2, 1.4))
LABEL_HEIGHT: Final = 0.085  # of a panel: labels of thresholds lie at least this far apart
LEFT, RIGHT = 0.075, 0.80


class Threshold(NamedTuple):
    """A line across a panel."""

    key: str
    value: float
    colour: str


def write_plots(results: dict[str, Assessment], times_s: dict[str, Floats], config: SurefootConfig, to: Path) -> None:
    """Write `CLIP.png` for every clip into the folder `to`, which is made if it is not there.

    Raises:
        SurefootError: the folder or a file cannot be written.
    """
    try:
        to.mkdir(parents=True, exist_ok=True)
        for name, result in results.items():
            path = to / f"{name.replace('/', '-')}.png"
            part = path.with_name(path.name + ".part")
            canvas: Any = FigureCanvasAgg(draw(name, times_s[name], result, config))
            with part.open("wb") as file:
                canvas.print_png(file)
            part.replace(path)
    except OSError as error:
        raise SurefootError(f"--plot {to}: cannot be written: {error.strerror}") from error


def draw(name: str, time_s: Floats, result: Assessment, config: SurefootConfig) -> Figure:
    """Return the picture of one clip; `time_s` (N,) is the time of its frames."""
    figure = Figure(figsize=(12.0, 9.4), facecolor="white", dpi=100)
    figure.suptitle(name, x=LEFT, ha="left", y=0.985, fontsize=13, fontweight="bold", color=INK)
    grid = figure.add_gridspec(
        5, 1, height_ratios=(0.28, 1.3, 1.2, 1.2, 1.0), hspace=0.13, left=LEFT, right=RIGHT, top=0.945, bottom=0.055
    )
    band = figure.add_subplot(grid[0])
    distance, probability, risk, stiffening = (figure.add_subplot(grid[index], sharex=band) for index in range(1, 5))
    for panel in (band, distance, probability, risk, stiffening):
        panel.tick_params(labelbottom=panel is stiffening, labelsize=9, colors=INK)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    band.set_xlim(float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1e-3))
    _draw_distance(distance, time_s, result, config)
    _draw_probability(probability, time_s, result, config)
    _draw_risk(risk, time_s, result, config)
    _draw_stiffening(stiffening, time_s, result, config)
    _draw_states(band, (distance, probability, risk, stiffening), time_s, result)
    stiffening.set_xlabel("time in the recording [s]", fontsize=10)
    return figure


def _draw_states(band: Any, panels: Sequence[Any], time_s: Floats, result: Assessment) -> None:
    begins = np.flatnonzero(np.append(True, result.state[1:] != result.state[:-1]))
    span = float(time_s[-1] - time_s[0])
    for begin, end in zip(begins, [*begins[1:], len(time_s) - 1], strict=True):
        state, colour = str(result.state[begin]), STATE_COLOUR[str(result.state[begin])]
        start, stop = float(time_s[begin]), float(time_s[end])
        band.axvspan(start, stop, facecolor=colour, edgecolor="white", linewidth=0.8)
        if stop - start > 0.011 * len(state) * span:
            band.text(0.5 * (start + stop), 0.5, state, ha="center", va="center", fontsize=8.5, color=INK)
        if state != "FOLLOW":
            for panel in panels:
                panel.axvspan(start, stop, facecolor=colour, alpha=0.25, linewidth=0, zorder=0)
    band.set_ylim(0.0, 1.0)
    band.set_yticks([0.5], ["state"])
    band.tick_params(axis="both", length=0)
    for side in ("left", "bottom"):
        band.spines[side].set_visible(False)


def _draw_distance(axes: Any, time_s: Floats, result: Assessment, config: SurefootConfig) -> None:
    axes.plot(time_s, result.distance[:, 0], color=INK, linewidth=1.5, label="now")
    axes.plot(time_s, result.distance[:, -1], color=AHEAD, linewidth=1.3, linestyle=DASHED, label="in 500 ms")
    axes.axhline(0.0, color=FAINT, linewidth=0.9, linestyle=":")
    axes.set_ylabel("distance to fall\nboundary [sd]", fontsize=10)
    known = result.distance[np.isfinite(result.distance)]
    intervention = config.intervention
    lines = (
        Threshold("distance_onset_sd", intervention.distance_onset_sd, TRANSIENT),
        Threshold("distance_full_sd", intervention.distance_full_sd, FALL),
        Threshold("approach_far_sd", intervention.approach_far_sd, AHEAD),
        Threshold("approach_near_sd", intervention.approach_near_sd, STABLE),
    )
    inside = [line.value for line in lines if abs(line.value) < 15.0]  # out of reach means switched off
    values = np.concatenate([known, inside, [0.0]])
    low, high = float(values.min()), float(values.max())
    axes.set_ylim(low - 0.06 * (high - low), high + 0.24 * (high - low))
    _thresholds(axes, lines)
    _legend(axes, 2)


def _draw_probability(axes: Any, time_s: Floats, result: Assessment, config: SurefootConfig) -> None:
    fall, not_stable = result.probabilities[:, :, 2], 1.0 - result.probabilities[:, :, 0]
    axes.plot(time_s, not_stable[:, 0], color=TRANSIENT, linewidth=1.3, label="transient or fall, now")
    axes.plot(time_s, fall[:, 0], color=FALL, linewidth=1.5, label="fall, now")
    axes.plot(time_s, fall[:, -1], color=FALL, linewidth=1.3, linestyle=DASHED, label="fall, in 500 ms")
    axes.set_ylim(-0.03, 1.27)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_ylabel("probability", fontsize=10)
    intervention = config.intervention
    _thresholds(
        axes,
        (
            Threshold("probability_onset", intervention.probability_onset, FALL),
            Threshold("probability_full", intervention.probability_full, FALL),
            Threshold("credible_onset", intervention.credible_onset, TRANSIENT),
            Threshold("credible_full", intervention.credible_full, TRANSIENT),
        ),
    )
    _legend(axes, 3)


def _draw_risk(axes: Any, time_s: Floats, result: Assessment, config: SurefootConfig) -> None:
    supervisor = config.supervisor
    near = max(round(supervisor.arrest_reach_s / STEP_S), 0) + 1
    axes.plot(time_s, result.risk.max(axis=1), color=AHEAD, linewidth=1.3, linestyle=DASHED, label="largest ahead")
    within = f"largest within {supervisor.arrest_reach_s * 1e3:.0f} ms"
    axes.plot(time_s, result.risk[:, :near].max(axis=1), color=INK, linewidth=1.5, label=within)
    axes.set_ylim(-0.03, 1.27)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_ylabel("risk", fontsize=10)
    _thresholds(
        axes,
        (
            Threshold("guard_on", supervisor.guard_on, AHEAD),
            Threshold("guard_off", supervisor.guard_off, AHEAD),
            Threshold("arrest_on", supervisor.arrest_on, INK),
            Threshold("arrest_off", supervisor.arrest_off, INK),
            Threshold("unconfirmed_most", config.intervention.unconfirmed_most, TRANSIENT),
        ),
    )
    _legend(axes, 2)


def _draw_stiffening(axes: Any, time_s: Floats, result: Assessment, config: SurefootConfig) -> None:
    axes.fill_between(time_s, result.stiffening, color=VIOLET, alpha=0.2, linewidth=0)
    axes.plot(time_s, result.stiffening, color=VIOLET, linewidth=1.5, label="stiffening")
    axes.plot(time_s, result.quality, color=FAINT, linewidth=1.2, label="quality of the horizon")
    axes.set_ylim(-0.03, 1.27)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    axes.set_ylabel("stiffening,\nquality", fontsize=10)
    intervention = config.intervention
    _thresholds(
        axes,
        (
            Threshold("trusted_quality", intervention.trusted_quality, FAINT),
            Threshold("unknown_risk", intervention.unknown_risk, VIOLET),
        ),
    )
    _legend(axes, 2)


def _thresholds(axes: Any, lines: Sequence[Threshold]) -> None:
    """Draw the lines that lie in the panel, named and valued beside it without overlap."""
    low, high = axes.get_ylim()
    shown = sorted((line for line in lines if low <= line.value <= high), key=lambda line: line.value)
    places = spread([(line.value - low) / (high - low) for line in shown], LABEL_HEIGHT)
    for line, place in zip(shown, places, strict=True):
        axes.axhline(line.value, color=line.colour, linewidth=0.9, linestyle=(0, (5, 2)), alpha=0.8, zorder=1)
        axes.annotate(
            f"{line.key} {line.value:g}", xy=(1.0, line.value), xycoords=("axes fraction", "data"),
            xytext=(1.02, place), textcoords="axes fraction", fontsize=8, color=line.colour, va="center",
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": line.colour, "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip


def _legend(axes: Any, columns: int) -> None:
    axes.legend(
        loc="upper left", ncols=columns, fontsize=8.5, frameon=True, framealpha=0.8, edgecolor="none", borderpad=0.2,
        handlelength=1.9, columnspacing=1.2,
    )  # fmt: skip
