"""`surefoot data`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from anticipation.training import detector_statistics
from anticipation.training.clips import data_folder
from anticipation.training.inventory import Inventory, describe_tracks, take_stock
from anticipation.training.own import SOURCE, read_own
from bridge.command_line.options import DataOption, JsonOption
from bridge.command_line.output import STDOUT, require_writable, result, result_console, status, write_json
from bridge.config.perception import CleaningConfig
from bridge.exit_codes import ExitCode


def data(
    data: DataOption = None,
    own: Annotated[
        Path | None, typer.Option("--own", metavar="FOLDER", help="Folder of your own recordings, too.")
    ] = None,
    noise: Annotated[bool, typer.Option("--noise", help="Measure how two pose estimators differ.")] = False,
    json: JsonOption = None,
) -> int:
    """Say which data is there to train on, check it, and count frames per class, with the licence of each source.

    What is missing is named with what it is for; what is damaged is named too, and the exit code is 1.

    Example: surefoot data --data /data/falls --own recordings --json runs/data.json

    How pose estimators differ: surefoot data --noise
    """
    place = data_folder(data)
    if json is not None:
        require_writable(json)
    if noise:
        with status("comparing the estimators"):
            measured = detector_statistics.measure(place)
        if json is not None:
            write_json(json, detector_statistics.plain(measured))
        if json != STDOUT:
            detector_statistics.show(measured, result_console())
        return ExitCode.DONE
    with status("reading the data"):
        stock = take_stock(place)
    if own is not None:
        mine = read_own(own, CleaningConfig())
        stock.sources.append(describe_tracks(f"own: {own}", SOURCE, mine.tracks, mine.problems))
        stock.problems.extend(mine.problems)
    if json is not None:
        write_json(json, _plain(stock, place))
    if json != STDOUT:
        _show(stock, place)
    return ExitCode.CHECK_FAILED if stock.problems else ExitCode.DONE


def _show(stock: Inventory, place: Path) -> None:
    table = Table(title=f"Research data in {place}")
    numbers = ("clips", "frames", "seconds", "stable", "transient", "fall", "no label")
    for column in ("source", *numbers, "licence"):
        table.add_column(column, justify="right" if column in numbers else "left")
    for source in stock.sources:
        counts = [f"{frames}" for frames in source.classes.values()]
        table.add_row(
            source.name, f"{source.clips}", f"{source.frames}", f"{source.seconds:.0f}", *counts, source.licence
        )
    result(table)
    for file in stock.missing:
        need = "needed by surefoot train and evaluate" if file.needed else "not needed to train"
        result(f"missing: {file.path} ({file.purpose}; {need})")
    for problem in stock.problems:
        result(f"damaged: {problem}")
    if not stock.problems:
        result(f"checked {len(stock.sources)} sources: shapes, numbers, labels and frame rates are as they should be")


def _plain(stock: Inventory, place: Path) -> dict[str, Any]:
    return {
        "folder": str(place),
        "sources": [asdict(source) for source in stock.sources],
        "missing": [file._asdict() for file in stock.missing],
        "problems": list(stock.problems),
    }
