"""One figure of two trials: how far the body sank, what the harness felt, what was foreseen and what was done."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.colours import FAINT, FALL, INK, STABLE, STATE_COLOUR, TRANSIENT
from bridge.launch.timeline import Row
from simulation.scenarios.arrest import ALLOWED_DROP_M
from simulation.trial.trace import Trace

BEFORE_S: Final = 3.0
AFTER_S: Final = 5.0


class Told(NamedTuple):
    """One trial: what the world says and what was on the wire, each with its own clock's zero at the event."""

    name: str
    trace: Trace
    event_s: float  # in the trace's time
    rows: Sequence[Row]
    rows_event_s: float  # in the rows' time


def draw(trials: Sequence[Told], out: Path) -> None:
    """Write the figure as PNG; the file is there whole or not at all."""
    figure = Figure(figsize=(11.0, 8.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid: Any = figure.subplots(4, len(trials), sharex=True, sharey="row", squeeze=False)
    for column, trial in enumerate(trials):
        _one(grid[:, column], trial)
    for axes, label in zip(
        grid[:, 0], ("pelvis below\nstanding [m]", "interface force [N]", "probability", "stiffening"), strict=True
    ):
        axes.set_ylabel(label)
    grid[0, 0].legend(loc="lower left", fontsize=8)
    grid[1, 0].legend(loc="upper left", fontsize=8)
    grid[2, 0].legend(loc="upper left", fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("time from the disturbance [s]")
    part = out.with_name(out.name + ".part")
    figure.savefig(part, dpi=110, format="png")
    part.replace(out)


def _one(axes: Any, trial: Told) -> None:
    trace, since = trial.trace, trial.trace.time_s - trial.event_s
    standing = float(trace.pelvis_m[(since > -BEFORE_S) & (since < 0), 2].mean())
    axes[0].set_title(trial.name, color=INK)
    axes[0].plot(since, trace.pelvis_m[:, 2] - standing, color=INK, label="pelvis")
    axes[0].axhline(-ALLOWED_DROP_M, color=FALL, linestyle="--", linewidth=1, label="arrest limit")
    axes[1].plot(since, -trace.wrench[:, 2], color=INK, label="hanging")
    axes[1].plot(since, np.hypot(trace.wrench[:, 0], trace.wrench[:, 1]), color=FAINT, label="horizontal")
    time_s = np.array([row.time_s for row in trial.rows]) - trial.rows_event_s
    for name, values, colour in (
        ("fall, in 500 ms", [row.fall_ahead for row in trial.rows], FALL),
        ("transient, in 500 ms", [row.transient_ahead for row in trial.rows], TRANSIENT),
        ("stable, in 500 ms", [row.stable_ahead for row in trial.rows], STABLE),
    ):
        axes[2].plot(time_s, values, color=colour, linewidth=1, label=name)
    axes[3].plot(time_s, [row.stiffening for row in trial.rows], color=INK)
    axes[3].set_ylim(-0.05, 1.05)
    _shade(axes, time_s, [row.state for row in trial.rows])
    for each in axes:
        each.axvline(0.0, color=FAINT, linewidth=1)
        each.set_xlim(-BEFORE_S, AFTER_S)


def _shade(axes: Any, time_s: Any, states: Sequence[str]) -> None:
    """Colour the background by the supervisor's state and name each stretch in the lowest panel."""
    begin = 0
    for index in range(1, len(states) + 1):
        if index < len(states) and states[index] == states[begin]:
            continue
        start, end = time_s[begin], time_s[min(index, len(states) - 1)]
        for each in axes:
            each.axvspan(start, end, color=STATE_COLOUR.get(states[begin], "#ffffff"), alpha=0.6, linewidth=0)
        shown = min(end, AFTER_S) - max(start, -BEFORE_S)
        if shown > 0.7:
            axes[3].text(max(start, -BEFORE_S) + 0.05, 0.9, states[begin], fontsize=7, color=INK)
        begin = index
