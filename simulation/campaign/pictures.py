"""The pictures of a campaign's report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from simulation.campaign.statistics import share
from simulation.scenarios.arrest import ALLOWED_DROP_M

COLOURS: Final = {"none": "#9a9a9a", "reactive": "#d08a2e", "anticipatory": "#2a6fb0"}
DOTS_PER_INCH: Final = 110


def draw_all(results: Sequence[dict[str, Any]], arms: Sequence[str], folder: Path) -> list[tuple[str, str]]:
    """Draw every picture for which there are results; return (file, caption) of each."""
    falls = [r for r in results if r["scenario"]["kind"] == "fall"]
    pictures: list[tuple[str, str]] = []
    if not falls:
        return pictures
    for name, figure, caption in (
        ("arrested.png", arrested(falls, arms), "Falls arrested, by family, with 95 % Wilson intervals."),
        ("drop.png", distribution(falls, arms, "pelvis_drop_m", "pelvis drop [m]", limit=ALLOWED_DROP_M),
         "Share of falls in which the pelvis came down by no more than this; broken line: an arrest."),
        ("force.png", distribution(falls, arms, "peak_force_weights", "peak interface force [body weights]"),
         "Share of falls with a peak force of no more than this."),
        ("leads.png", leads(falls, arms),
         "How long before the descent: the first stiffening, and the first horizon that held a fall."),
        ("examples.png", examples(falls, arms), "One fall of each family, second by second, from the disturbance."),
    ):  # fmt: skip
        figure.savefig(folder / name, dpi=DOTS_PER_INCH)
        pictures.append((name, caption))
    return pictures


def arrested(falls: Sequence[dict[str, Any]], arms: Sequence[str]) -> Figure:
    """Return bars of the share of falls arrested."""
    families = sorted({r["scenario"]["family"] for r in falls})
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    axes = figure.subplots()
    width = 0.8 / len(arms)
    for index, arm in enumerate(arms):
        for place, family in enumerate((*families, "all")):
            hits = [r["trials"][arm]["measures"]["arrested_fall"] for r in falls
                    if family in (r["scenario"]["family"], "all")]  # fmt: skip
            e = share(sum(hits), len(hits))
            axes.bar(
                place + (index - (len(arms) - 1) / 2) * width, e.value, width, color=COLOURS[arm],
                yerr=[[e.value - e.low], [e.high - e.value]], error_kw={"lw": 0.8}, label=arm if place == 0 else None,
            )  # fmt: skip
    axes.set_xticks(range(len(families) + 1), [*families, "all"])
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("share arrested")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def distribution(
    falls: Sequence[dict[str, Any]], arms: Sequence[str], name: str, label: str, limit: float | None = None
) -> Figure:
    """Return cumulative distributions of a measure."""
    figure = Figure(figsize=(6.0, 3.2), layout="constrained")
    axes = figure.subplots()
    for arm in arms:
        values = np.sort([r["trials"][arm]["measures"][name] for r in falls])
        axes.step(values, np.arange(1, len(values) + 1) / len(values), where="post", color=COLOURS[arm], label=arm)
    if limit is not None:
        axes.axvline(limit, color="black", lw=0.8, ls="--")
    axes.set_xlabel(label)
    axes.set_ylabel("share of falls")
    axes.set_ylim(0, 1.02)
    axes.legend(frameon=False)
    return figure


def leads(falls: Sequence[dict[str, Any]], arms: Sequence[str]) -> Figure:
    """Return leads as dots, one row for each arm and kind of lead."""
    figure = Figure(figsize=(8.0, 0.6 + 0.45 * 4 * len(arms)), layout="constrained")
    axes = figure.subplots()
    rows: list[str] = []
    rng = np.random.default_rng(0)
    for arm in arms:
        for name, what in (
            ("lead_s", "stiff"),
            ("unsteady_lead_s", "not stable"),
            ("foreseen_lead_s", "fall foreseen"),
            ("seen_lead_s", "fall seen"),
        ):
            values = np.array([r["trials"][arm]["measures"][name] for r in falls])
            values = values[np.isfinite(values)]
            rows.append(f"{arm}: {what} ({len(values)})")
            heights = len(rows) - 1 + rng.uniform(-0.2, 0.2, len(values))
            axes.plot(values, heights, ".", color=COLOURS[arm], ms=4, alpha=0.7)
            if len(values):
                axes.plot(np.median(values), len(rows) - 1, "|", color="black", ms=16)
    axes.set_yticks(range(len(rows)), rows)
    axes.invert_yaxis()
    axes.axvline(0.0, color="black", lw=0.8, ls="--")
    axes.set_xlim(-1.5, 1.5)
    axes.set_xlabel("before (+) or after (-) the descent began [s]")
    return figure


def examples(falls: Sequence[dict[str, Any]], arms: Sequence[str]) -> Figure:
    """Return one fall of each family: height of the pelvis, force, stiffening, probability of a fall."""
    families = sorted({r["scenario"]["family"] for r in falls})
    figure = Figure(figsize=(3.1 * len(families), 7.2), layout="constrained")
    grid = figure.subplots(4, len(families), squeeze=False, sharex="col")
    for column, family in enumerate(families):
        result = next(r for r in falls if r["scenario"]["family"] == family)
        grid[0, column].set_title(f"{family}\n{result['name']}, {result['scenario']['person_mass_kg']:.0f} kg", size=9)
        for arm in arms:
            curves = result["trials"][arm]["curves"]
            time = np.array(curves["time_s"]) - result["scenario"]["event_s"]
            heard = np.array(curves["horizon_s"]) - result["scenario"]["event_s"]
            for row, (x, name) in enumerate(
                ((time, "pelvis_m"), (time, "force_n"), (time, "stiffening"), (heard, "falls_ahead"))
            ):
                grid[row, column].plot(x, curves[name], color=COLOURS[arm], lw=1.1, label=arm)
        grid[3, column].set_xlim(-0.5, 3.0)
        grid[3, column].set_xlabel("after the disturbance is due [s]", size=8)
    for row, label in enumerate(("pelvis [m]", "force [N]", "stiffening", "most probable fall ahead")):
        grid[row, 0].set_ylabel(label, size=8)
    grid[0, 0].legend(frameon=False, fontsize=7)
    for axes in grid.flat:
        axes.tick_params(labelsize=7)
    return figure
