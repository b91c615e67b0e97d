"""`surefoot evaluate`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import torch
import typer

from anticipation.training import simulated
from anticipation.training.clips import data_folder
from anticipation.training.corpus import read_corpus
from anticipation.training.evaluation import records
from anticipation.training.evaluation.protocols import NOT_LIVE, Study, cross, grouped, observed, paper
from anticipation.training.evaluation.recordings import read_recordings
from anticipation.training.evaluation.records import Predictions
from anticipation.training.evaluation.results import results_of
from anticipation.training.networks import progress_bars
from anticipation.training.plan import WITH_SIMULATED, RecipeName, plan_for
from anticipation.training.report.console import show
from anticipation.training.report.folder import (
    predictions_path,
    read_experiment,
    render,
    stored_predictions,
)
from anticipation.training.report.page import PAGE
from bridge.command_line.options import ConfigOption, DataOption, JsonOption, SeedOption, SetOption
from bridge.command_line.output import STDOUT, note, require_writable, result_console, write_json
from bridge.config.load import load_config
from bridge.errors import SourceError


class Protocol(StrEnum):
    """How recordings are divided into training and test."""

    GROUPED = "grouped"
    PAPER = "paper"
    CROSS = "cross"


class Keypoints(StrEnum):
    """Whose tracks of the URFD falls are tested."""

    ALPHAPOSE = "alphapose"
    MOVENET = "movenet"
    BOTH = "both"


def evaluate(
    data: DataOption = None,
    protocol: Annotated[
        Protocol, typer.Option(help="Split by recording, as the paper may have, or across data sets.")
    ] = Protocol.GROUPED,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Folder of the report: page, pictures, predictions and checkpoints.",
            show_default=False,
        ),
    ] = None,
    stored: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="FOLDER",
            help="Compute and draw again from a report's folder; nothing is trained.",
            show_default=False,
        ),
    ] = None,
    folds: Annotated[int, typer.Option(min=2, max=24, help="Folds, divided by recording.")] = 5,
    seed: SeedOption = 0,
    recipe: Annotated[
        RecipeName, typer.Option(help="Networks and how they learn: the shipped ones, or others.")
    ] = RecipeName.SUREFOOT,
    keypoints: Annotated[
        Keypoints, typer.Option(help="Tracks of the falls that the tables are made of.")
    ] = Keypoints.ALPHAPOSE,
    epochs: Annotated[int | None, typer.Option(min=1, max=300, help="Epochs of the shipped classifier.")] = None,
    baselines: Annotated[bool, typer.Option(help="Fit and test the simpler ways too.")] = True,
    live: Annotated[
        bool | None,
        typer.Option(
            "--live/--no-live",
            help="Run every clip through the whole system. With --from: again, with the stored checkpoints.",
            show_default="live, but not with --from",
        ),
    ] = None,
    experiments: Annotated[
        list[Path] | None,
        typer.Option("--experiment", metavar="FILE.json", help="Table measured apart, for the page; repeatable."),
    ] = None,
    clips: Annotated[
        Path | None,
        typer.Option(
            "--simulated", metavar="FOLDER", help="Folder of `surefoot clips` to learn from too.", show_default=False
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few small fits, to see that everything runs.")] = False,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> None:
    """Measure how well recordings are foreseen that no network has seen.

    Prints the main tables. With --out, writes page, pictures, numbers (PROTOCOL.json), what the networks said of
    every clip (PROTOCOL.npz) and the networks; several protocols may share a folder, and one page shows them all.

    Example: surefoot evaluate --protocol grouped --out runs/report

    Draw again, without training: surefoot evaluate --from runs/report --out runs/report
    """
    parsed = load_config(config, set_ or [])
    if live and protocol is Protocol.PAPER:
        raise SourceError(NOT_LIVE)
    told = [read_experiment(path) for path in experiments or []]
    if json is not None:
        require_writable(json)
    if out is not None:
        require_writable(out / PAGE, "--out")
    torch.set_num_threads(1)  # more give other sums, and on a busy machine no speed
    with TemporaryDirectory() as scratch, progress_bars() as progress:
        place = stored or out or Path(scratch)

        def study(seed: int, keypoints: str) -> Study:
            plan = plan_for(recipe, seed, quick, epochs)
            plan = plan if clips is None or quick else plan.larger(WITH_SIMULATED)
            folder = data_folder(data)
            acted = () if clips is None else simulated.read(clips)
            corpus = read_corpus(folder, plan.mocap_clips, seed, simulated=acted)
            filmed = read_recordings(folder, corpus, plan.mocap_clips, seed)
            return Study(corpus, filmed, plan, seed, place, parsed, progress, keypoints, baselines, live is not False)

        if stored is None:
            made = _run(study(seed, keypoints.value), protocol, folds)
        else:
            made = stored_predictions(stored, protocol.value)
            if live:
                made = observed(made, study(int(made.meta["seed"]), str(made.meta["keypoints"])))
        if live if stored is not None else out is not None:
            records.save(made, predictions_path(place, protocol.value))
    results = results_of(made)
    if json is not None:
        write_json(json, results)
    if json != STDOUT:
        show(results, result_console())
    if out is not None:
        note(f"report: {render(place, out, told)}")


def _run(study: Study, protocol: Protocol, folds: int) -> Predictions:
    if protocol is Protocol.GROUPED:
        return grouped(study, folds)
    if protocol is Protocol.PAPER:
        return paper(study)
    return cross(study)
