"""The main tables of an evaluation in a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

ERROR_AT_MS: Final = (100, 300, 500)


def show(results: Mapping[str, Any], console: Console) -> None:
    """Print accuracy, macro-F1 and forecast error."""
    for title, table in results["tables"].items():
        tested, excluded = table["tested_frames"], table["excluded_frames"]
        console.print(
            f"{results['protocol']}, {title}: {tested} labelled frames tested; {excluded} "
            f"({excluded / max(1, tested + excluded):.1%}) excluded, whose window of 15 frames is not whole. "
            f"Mean and sd over {len(table['parts'])} test part(s)."
        )
        for kind, name in (("accuracy", "Accuracy"), ("macro_f1", "Macro-F1")):
            _table(console, f"{name} of the state h ahead", results["horizons_ms"], table[kind])
    at = [results["error_horizons_ms"].index(ms) for ms in ERROR_AT_MS]
    for kind, rows in results["forecast_error"].items():
        few = {name: np.array(parts)[:, at] for name, parts in rows.items()}
        _table(console, f"Forecast error, relative coordinates, {escape(kind)}", ERROR_AT_MS, few)


def _table(console: Console, title: str, horizons_ms: Sequence[int], rows: Mapping[str, Any]) -> None:
    table = Table(title=title)
    table.add_column("", no_wrap=True)
    for ms in horizons_ms:
        table.add_column(f"{ms} ms", justify="right")
    for name, parts in rows.items():
        values = np.array(parts, dtype=np.float64)
        mean, spread = np.nanmean(values, axis=0), np.nanstd(values, axis=0)
        digits = 1 if np.nanmax(mean) > 2 else 3
        table.add_row(name, *(f"{a:.{digits}f} ± {b:.{digits}f}" for a, b in zip(mean, spread, strict=True)))
    console.print(table)
