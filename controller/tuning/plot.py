"""The trade-off as a picture: falls caught, and lead time, against needless interventions per hour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from math import isfinite
from typing import Any, Final

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bridge.colours import FAINT, FALL, INK, STABLE, TRANSIENT
from controller.tuning.confidence import wilson
from controller.tuning.recommend import Answer
from controller.tuning.score import Outcome

DPI: Final = 110


def draw(answer: Answer) -> Figure:
    """Return the picture of an answer."""
    figure = Figure(figsize=(12.0, 5.4), facecolor="white", dpi=DPI)
    caught, lead = figure.subplots(1, 2)
    budget = answer.question.budget_per_hour
    for axes in (caught, lead):
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.grid(color="#eeeeee", linewidth=0.8, zorder=0)
        axes.tick_params(labelsize=9, colors=INK)
        axes.set_xlabel("needless interventions per hour", fontsize=10)
    _panel(caught, answer, lambda one: 100.0 * one.caught_share)
    _panel(lead, answer, lambda one: one.lead_median_s)
    share, spread = wilson(answer.judged.caught, answer.judged.falls), answer.resampled.lead_median_s
    _interval(caught, answer.judged.per_hour, 100.0 * share.low, 100.0 * share.high)
    _interval(lead, answer.recommended.outcome.per_hour, spread.low, spread.high)
    caught.set_ylabel("falls caught [%]", fontsize=10)
    caught.set_ylim(-4.0, 107.0)
    lead.set_ylabel("median lead before the impact [s]", fontsize=10)
    lead.set_ylim(bottom=0.0)
    rates = [one.per_hour for one in answer.every if isfinite(one.per_hour)]
    most = max([*rates, budget, 1e-9])
    for axes in (caught, lead):
        axes.set_xlim(-0.04 * most, 1.06 * most)
        axes.axvline(budget, color=STABLE, linewidth=1.0, linestyle=(0, (4, 3)), zorder=1)
        axes.annotate(
            f"budget {budget:g}", (budget, 1.0), xycoords=("data", "axes fraction"), xytext=(3, 4),
            textcoords="offset points", fontsize=8.5, color=STABLE,
        )  # fmt: skip
    handles, labels = caught.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=5, fontsize=9, frameon=False, bbox_to_anchor=(0.5, 0.0))
    hours = answer.recommended.outcome.hours
    figure.suptitle(
        f"{answer.tried} settings on {len(answer.cases)} recordings: {answer.recommended.outcome.falls} falls, "
        f"{hours:.2f} h without", x=0.06, ha="left", fontsize=12, fontweight="bold", color=INK,
    )  # fmt: skip
    figure.tight_layout(rect=(0.0, 0.06, 1.0, 0.98))
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    canvas: Any = FigureCanvasAgg(figure)
    buffer = BytesIO()
    canvas.print_png(buffer)
    return buffer.getvalue()


def _panel(axes: Any, answer: Answer, value: Callable[[Outcome], float]) -> None:
    def points(outcomes: Sequence[Outcome]) -> tuple[list[float], list[float]]:
        known = [(one.per_hour, value(one)) for one in outcomes]
        known = [point for point in known if isfinite(point[0]) and isfinite(point[1])]
        return [point[0] for point in known], [point[1] for point in known]

    axes.plot(
        *points(answer.every), "o", color=FAINT, alpha=0.35, markersize=4, markeredgewidth=0, label="tried", zorder=2
    )  # fmt: skip
    front = [judged.outcome for judged in answer.front]
    axes.plot(*points(front), "o", color=TRANSIENT, markersize=6.5, label="none better", zorder=3)
    axes.plot(
        *points([answer.present.outcome]), "D", markerfacecolor="none", markeredgecolor=INK, markersize=15,
        markeredgewidth=1.6, label="present values", zorder=4,
    )  # fmt: skip
    best = answer.recommended.outcome
    axes.plot(*points([best]), "*", color=FALL, markersize=17, markeredgecolor="white", label="recommended", zorder=5)
    if answer.held_out is None:
        return
    x, y = points([answer.held_out])
    if x:  # 95 % interval
        axes.plot((answer.needless.low, answer.needless.high), y * 2, color=FALL, linewidth=1.0, alpha=0.6, zorder=1.5)
    axes.plot(
        x, y, "*", markerfacecolor="none", markeredgecolor=FALL, markersize=21, markeredgewidth=1.3,
        label="chosen without, judged on (95 %)", zorder=5,
    )  # fmt: skip


def _interval(axes: Any, x: float, low: float, high: float) -> None:
    """Draw a 95 % interval along y."""
    if isfinite(x) and isfinite(low):
        axes.plot((x, x), (low, high), color=FALL, linewidth=1.0, alpha=0.6, zorder=1.5)
