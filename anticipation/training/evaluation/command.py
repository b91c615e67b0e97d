"""`surefoot evaluate`."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import torch
import typer
from rich.console import Console

from anticipation.training.clips import data_folder
from anticipation.training.corpus import read_corpus
from anticipation.training.evaluation import protocols, records
from anticipation.training.evaluation.protocols import Study
from anticipation.training.evaluation.recordings import read_recordings
from anticipation.training.evaluation.records import Predictions
from anticipation.training.evaluation.results import results_of
from anticipation.training.networks import progress_bars
from anticipation.training.plan import plan_for
from anticipation.training.report.console import show
from bridge.config.load import load_config
from bridge.errors import SurefootError


class Forecaster(StrEnum):
    """Forecasters that can be trained."""

    LSTM = "lstm"
    DCT_MLP = "dct_mlp"


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
    data: Annotated[
        Path | None,
        typer.Option("--data", envvar="SUREFOOT_DATA", help="Folder of the research data.", show_default=False),
    ] = None,
    protocol: Annotated[
        Protocol, typer.Option(help="Split by recording, as the paper may have, or across data sets.")
    ] = Protocol.GROUPED,
    report: Annotated[Path | None, typer.Option(help="Folder for page, pictures, predictions and checkpoints.")] = None,
    stored: Annotated[
        Path | None, typer.Option("--from", help="Compute and draw again from a report's folder; nothing is trained.")
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write every number to this file.")] = None,
    folds: Annotated[int, typer.Option(min=2, max=24, help="Folds, divided by recording.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Seed of folds, draws and weights.")] = 0,
    forecaster: Annotated[Forecaster, typer.Option(help="Network that foresees the motion.")] = Forecaster.DCT_MLP,
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
    config: Annotated[Path | None, typer.Option(help="Configuration of the live pass; default: built-in.")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override one value; repeatable.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A few small fits, to see that everything runs.")] = False,
) -> None:
    """Measure how well recordings are foreseen that no network has seen.

    Example: surefoot evaluate --protocol grouped --report runs/report
    """
    parsed = load_config(config, settings or [])
    if json_file is not None:
        _writable(json_file)
    torch.set_num_threads(1)  # more give other sums, and on a busy machine no speed
    if stored is not None:
        made = records.load(_predictions(stored, protocol))
    else:
        folder = data_folder(data)
        with TemporaryDirectory() as scratch, progress_bars() as progress:
            place = Path(scratch) if report is None else report
            place.mkdir(parents=True, exist_ok=True)
            plan = plan_for(forecaster.value, seed, quick, epochs)
            corpus = read_corpus(folder, plan.mocap_clips, seed, parsed.perception.cleaning)
            filmed = read_recordings(folder, corpus, plan.mocap_clips, seed)
            study = Study(
                corpus, filmed, plan, seed, place, parsed, progress, keypoints.value, baselines, live is not False
            )
            made = _run(study, protocol, folds)
            if report is not None:
                records.save(made, _predictions(report, protocol))
    results = results_of(made)
    show(results, Console() if Console().is_terminal else Console(width=140))
    if json_file is not None:
        json_file.write_text(json.dumps(results, indent=1) + "\n")


def _predictions(folder: Path, protocol: Protocol) -> Path:
    return folder / f"{protocol.value}.npz"


def _run(study: Study, protocol: Protocol, folds: int) -> Predictions:
    if protocol is Protocol.GROUPED:
        return protocols.grouped(study, folds)
    if protocol is Protocol.PAPER:
        return protocols.paper(study)
    return protocols.cross(study)


def _writable(path: Path) -> None:
    """Make the folder of an output file, before hours are spent on its content.

    Raises:
        SurefootError: it cannot be made, or the path is a folder.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SurefootError(f"cannot write '{path}': {error.strerror}") from error
    if path.is_dir():
        raise SurefootError(f"cannot write '{path}': it is a folder")
