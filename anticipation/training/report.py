"""An evaluation as tables to read and as JSON to keep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from anticipation.training.evaluation import ALARM, Outcome
from anticipation.training.measures import ERROR_STEPS, STEPS, calibration_error, temperatures
from bridge.messages import STEP_S, Floats

_ERRORS: Final = (
    ("all_body", "all frames [body lengths]"),
    ("all_px", "all frames [px]"),
    ("falling_body", "falling [body lengths]"),
    ("falling_px", "falling [px]"),
)


def show(outcome: Outcome, protocol: str, console: Console) -> None:
    """Print accuracy, macro-F1, forecast error and alarms."""
    share = outcome.excluded / max(1, outcome.tested + outcome.excluded)
    console.print(
        f"{protocol}: {outcome.tested} labelled frames tested; {outcome.excluded} ({share:.1%}) excluded, whose "
        f"window of 15 frames is not whole. Mean and sd over {len(outcome.logits)} test part(s)."
    )
    for kind, title in (("accuracy", "Accuracy of the state h ahead"), ("macro_f1", "Macro-F1 of the state h ahead")):
        rows = {name: [getattr(part, kind) for part in parts] for name, parts in outcome.scores.items()}
        _table(console, title, STEPS, rows)
    for kind, title in _ERRORS:
        rows = {name: [getattr(part, kind) for part in parts] for name, parts in outcome.errors.items()}
        _table(console, f"Forecast error, relative coordinates, {escape(title)}", ERROR_STEPS, rows)
    if outcome.alarms:
        table = Table(title=f"Windows without a fall in which p(fall) at 500 ms > {ALARM}, recordings not learnt from")
        for column in ("motion", "alarms", "windows", "share"):
            table.add_column(column, justify="left" if column == "motion" else "right")
        for name, (alarms, windows) in _totals(outcome).items():
            table.add_row(name, str(alarms), str(windows), f"{alarms / windows:.2%}")
        console.print(table)


def as_json(outcome: Outcome, protocol: str, seed: int) -> dict[str, Any]:
    """Return every number of the evaluation, per fold, and the calibration that follows from it."""
    logits, labels = np.concatenate(outcome.logits), np.concatenate(outcome.labels)
    temperature = temperatures(logits, labels)
    return {
        "protocol": protocol,
        "seed": seed,
        "shipped": outcome.shipped,
        "horizons_ms": [round(1000 * step * STEP_S) for step in STEPS],
        "error_horizons_ms": [round(1000 * step * STEP_S) for step in ERROR_STEPS],
        "tested_frames": outcome.tested,
        "excluded_frames": outcome.excluded,
        "accuracy": {name: [_rounded(part.accuracy) for part in parts] for name, parts in outcome.scores.items()},
        "macro_f1": {name: [_rounded(part.macro_f1) for part in parts] for name, parts in outcome.scores.items()},
        "forecast_error": {
            kind: {name: [_rounded(getattr(part, kind)) for part in parts] for name, parts in outcome.errors.items()}
            for kind, _ in _ERRORS
        },
        "alarms": {name: list(total) for name, total in _totals(outcome).items()},
        "temperature": _rounded(temperature),
        "calibration_error_before": _rounded(_calibration(logits, labels, np.ones_like(temperature))),
        "calibration_error_after": _rounded(_calibration(logits, labels, temperature)),
    }


def _table(console: Console, title: str, steps: Sequence[int], rows: dict[str, list[Floats]]) -> None:
    table = Table(title=title)
    table.add_column("", no_wrap=True)
    for step in steps:
        table.add_column(f"{round(1000 * step * STEP_S)} ms", justify="right")
    for name, parts in rows.items():
        mean, spread = np.nanmean(parts, axis=0), np.nanstd(parts, axis=0)
        digits = 1 if mean.max() > 2 else 3
        cells = [f"{a:.{digits}f} ± {b:.{digits}f}" for a, b in zip(mean, spread, strict=True)]
        table.add_row(name, *cells)
    console.print(table)


def _totals(outcome: Outcome) -> dict[str, tuple[int, int]]:
    return {
        name: (sum(alarms for alarms, _ in parts), sum(windows for _, windows in parts))
        for name, parts in sorted(outcome.alarms.items())
    }


def _calibration(logits: NDArray[np.floating], labels: NDArray[np.int64], temperature: Floats) -> Floats:
    """Expected calibration error at each of `STEPS`."""
    errors = []
    for step in STEPS:
        there = labels[:, step] >= 0
        scaled = logits[there, step] / temperature[step]
        weights = np.exp(scaled - scaled.max(axis=1, keepdims=True))
        errors.append(calibration_error(weights / weights.sum(axis=1, keepdims=True), labels[there, step]))
    return np.array(errors)


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 4) for value in values]
