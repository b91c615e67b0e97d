"""`surefoot data`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from anticipation.training import detector_statistics
from anticipation.training.clips import data_folder
from anticipation.training.inventory import Inventory, describe_tracks, take_stock
from anticipation.training.own import SOURCE, read_own
from bridge.config.perception import CleaningConfig
from bridge.errors import SurefootError

DAMAGED = 2  # exit code: something there is not what it should be


def data(
    folder: Annotated[
        Path | None, typer.Option("--data", envvar="SUREFOOT_DATA", help="Folder of the research data.")
    ] = None,
    own: Annotated[Path | None, typer.Option("--own", help="Folder of your own recordings, too.")] = None,
    noise: Annotated[bool, typer.Option("--noise", help="Measure how two pose estimators differ.")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write every number to this file.")] = None,
) -> int:
    """Say which data is there to train on, check it, and count frames per class, with the licence of each source.

    What is missing is named with what it is for; what is damaged is named too, and the exit code is 2.

    Examples: `surefoot data --data /data/falls`, `surefoot data --own recordings --json runs/data.json`,
    `surefoot data --noise`.
    """
    place = data_folder(folder)
    if noise:
        detector_statistics.show(detector_statistics.measure(place), _console())
        return 0
    stock = take_stock(place)
    if own is not None:
        mine = read_own(own, CleaningConfig())
        stock.sources.append(describe_tracks(f"own: {own}", SOURCE, mine.tracks, mine.problems))
        stock.problems.extend(mine.problems)
    _show(stock, place, _console())
    if json_file is not None:
        try:
            json_file.parent.mkdir(parents=True, exist_ok=True)
            json_file.write_text(json.dumps(_plain(stock, place), indent=1) + "\n")
        except OSError as error:
            raise SurefootError(f"cannot write '{json_file}': {error.strerror}") from error
    return DAMAGED if stock.problems else 0


def _show(stock: Inventory, place: Path, console: Console) -> None:
    table = Table(title=f"Research data in {place}")
    numbers = ("clips", "frames", "seconds", "stable", "transient", "fall", "no label")
    for column in ("source", *numbers, "licence"):
        table.add_column(column, justify="right" if column in numbers else "left")
    for source in stock.sources:
        counts = [f"{frames}" for frames in source.classes.values()]
        table.add_row(
            source.name, f"{source.clips}", f"{source.frames}", f"{source.seconds:.0f}", *counts, source.licence
        )
    console.print(table)
    for file in stock.missing:
        need = "needed by surefoot train and evaluate" if file.needed else "not needed to train"
        console.print(f"missing: {file.path} ({file.purpose}; {need})", markup=False)
    for problem in stock.problems:
        console.print(f"damaged: {problem}", markup=False)
    if not stock.problems:
        console.print(
            f"checked {len(stock.sources)} sources: shapes, numbers, labels and frame rates are as they should be"
        )


def _plain(stock: Inventory, place: Path) -> dict[str, Any]:
    return {
        "folder": str(place),
        "sources": [asdict(source) for source in stock.sources],
        "missing": [file._asdict() for file in stock.missing],
        "problems": list(stock.problems),
    }


def _console() -> Console:
    """A terminal as it is; a file or a pipe wide enough for the table."""
    console = Console()
    return console if console.is_terminal else Console(width=160)
