"""`surefoot train`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console

from anticipation import checkpoint
from anticipation.training import production
from anticipation.training.clips import data_folder
from anticipation.training.corpus import read_corpus
from anticipation.training.networks import progress_bars
from anticipation.training.plan import plan_for
from bridge.config.perception import CleaningConfig
from bridge.errors import SurefootError


class Forecaster(StrEnum):
    """Forecasters that can be trained."""

    LSTM = "lstm"
    DCT_MLP = "dct_mlp"


Data = Annotated[
    Path | None, typer.Option("--data", envvar="SUREFOOT_DATA", help="Folder of the research data.", show_default=False)
]
Quick = Annotated[bool, typer.Option("--quick", help="A few small fits, to see that everything runs.")]
Epochs = Annotated[int | None, typer.Option(min=1, max=300, help="Epochs of the shipped classifier.")]
Folds = Annotated[int, typer.Option(min=2, max=24, help="Folds, divided by recording.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of folds, draws and weights.")]


def train(
    data: Data = None,
    out: Annotated[Path, typer.Option(help="Checkpoint to write (.safetensors).")] = Path("surefoot.safetensors"),
    seed: Seed = 0,
    forecaster: Annotated[Forecaster, typer.Option(help="Network that foresees the motion.")] = Forecaster.DCT_MLP,
    epochs: Epochs = None,
    folds: Folds = 5,
    evaluated: Annotated[
        Path | None,
        typer.Option("--evaluation", help="JSON of `surefoot evaluate`: calibration and metrics for the checkpoint."),
    ] = None,
    quick: Quick = False,
) -> None:
    """Fit the networks to every recording and write a checkpoint."""
    folder = data_folder(data)
    measured = None if evaluated is None else production.read_evaluation(evaluated)
    _writable(out)
    plan = plan_for(forecaster.value, seed, quick, epochs)
    _one_thread()
    corpus = read_corpus(folder, plan.mocap_clips, seed, CleaningConfig())
    with progress_bars() as progress:
        made = production.make_checkpoint(corpus, plan, folds, seed, measured, progress)
    checkpoint.save(made, out)
    Console().print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _one_thread() -> None:
    """More threads give other sums, and on a busy machine no speed."""
    torch.set_num_threads(1)


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
