"""How a risk that is foreseen becomes a stiffening profile over the stages of the MPC."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from paper import quiet, sheet
from trial import Trial

from bridge.clock import NS
from bridge.colours import FALL, FORECAST, INK
from controller.intervention.risk import assess_risk
from controller.intervention.stiffening import Rates, stiffening_profile

LEAD_S: Final = (-0.133, -0.067, 0.0, 0.067)  # moments, since the present first stiffens


def draw_profile(trial: Trial) -> Figure:
    """Return the picture."""
    rows = _history(trial)
    begins = next(time for time, _, profile in rows if profile[0] > 0.0)
    figure = sheet("Foreseen first, felt later: risk and the stiffening profile of the MPC's stages", 11, 4.6)
    grid = figure.add_gridspec(1, len(LEAD_S), left=0.065, right=0.98, top=0.8, bottom=0.14, wspace=0.12)
    mpc = trial.config.mpc
    stages = np.arange(len(rows[0][2])) * mpc.stage_s * 1e3
    for column, lead in enumerate(LEAD_S):
        axes: Any = figure.add_subplot(grid[column])
        _, asked, profile = min(rows, key=lambda row: abs(row[0] - begins - lead))
        axes.fill_between(stages, asked, color=FALL, alpha=0.18, linewidth=0, label="asked for by the risk")
        axes.step(stages, profile, where="post", color=FORECAST, linewidth=2.2, label="profile $s_k$")
        axes.plot(0, profile[0], "o", color=INK, markersize=9, clip_on=False, label="present stiffening $s_0$")
        axes.set_ylim(0, 1.02)
        axes.set_xlim(0, stages[-1])
        when = f"{abs(lead) * 1e3:.0f} ms {'before' if lead < 0 else 'after'}"
        axes.set_title("the present begins to stiffen" if lead == 0 else when, fontsize=10.5, color=INK)
        axes.set_xlabel("ahead of now [ms]", fontsize=10)
        axes.tick_params(labelleft=column == 0)
        quiet(axes)
        if column == 0:
            axes.set_ylabel("stiffening", fontsize=10)
            handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="upper right", ncols=3, fontsize=9, frameon=False, bbox_to_anchor=(0.985, 0.94))
    return figure


def _history(trial: Trial) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return time since the onset, stiffening asked for (N,), profile (N,), at each frame."""
    config, mpc = trial.config.intervention, trial.config.mpc
    rates = Rates(config.rise_per_s, config.release_per_s)
    present, before_ns = 0.0, trial.horizons[0].stamp_ns
    ahead = np.arange(mpc.stages) * mpc.stage_s
    rows = []
    for time_s, horizon in zip(trial.time_s, trial.horizons, strict=True):
        risk = assess_risk(horizon, config).total
        asked = np.interp(ahead, np.arange(len(risk)) * horizon.step_s, risk)
        elapsed_s = (horizon.stamp_ns - before_ns) / NS
        profile = stiffening_profile(present, asked, elapsed_s, mpc.stage_s, rates)
        present, before_ns = float(profile[0]), horizon.stamp_ns
        rows.append((float(time_s), asked, profile))
    return rows
