"""The main tables of an evaluation in a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table as Shown

from anticipation.training.report import tables
from anticipation.training.report.tables import Results, Table


def show(results: Results, console: Console) -> None:
    """Print accuracy, macro-F1, forecast error, calibration and, where the whole system was run, what it did."""
    for table in _main(results):
        shown = Shown(
            title=escape(table.title), caption=escape(table.note), title_justify="left", caption_justify="left"
        )
        for number, name in enumerate(table.head):
            shown.add_column(escape(name), justify="right" if number else "left", no_wrap=not number)
        for row in table.rows:
            shown.add_row(*(escape(cell) for cell in row))
        console.print(shown)


def _main(results: Results) -> Iterator[Table]:
    for name, title in (("urfd", "URFD falls"), ("upfall", "UP-Fall falls")):
        if name in results["tables"]:
            for kind, what in tables.KINDS.items():
                yield tables.table_3(results, name, kind, f"{title}, {results['protocol']} protocol: {what}")
    if results["forecast_error"]:
        yield tables.table_2(results)
        yield tables.against_naive(results)
        yield tables.calibration(results)
    if "events" in results:
        yield tables.events(results)
        yield tables.daily(results)
