"""`surefoot train`."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import torch
import typer

from anticipation import checkpoint
from anticipation.training import production, simulated
from anticipation.training.clips import data_folder, required
from anticipation.training.corpus import read_corpus
from anticipation.training.inventory import FILES
from anticipation.training.journal import Journal
from anticipation.training.log import Log, available
from anticipation.training.networks import progress_bars
from anticipation.training.own import read_own
from anticipation.training.plan import WITH_SIMULATED, Plan, RecipeName, plan_for
from anticipation.training.run import Run
from anticipation.training.samples import Track
from anticipation.training.team import Team, joined
from bridge.command_line.options import DataOption, ForceOption, SeedOption
from bridge.command_line.output import note, require_writable
from bridge.config.perception import CleaningConfig
from bridge.errors import SourceError, SurefootError

Quick = Annotated[bool, typer.Option("--quick", help="A few small fits, to see that everything runs.")]
Epochs = Annotated[int | None, typer.Option(min=1, max=300, help="Epochs of the shipped classifier.")]
Folds = Annotated[int, typer.Option(min=2, max=24, help="Folds, divided by recording.")]
Simulated = Annotated[
    Path | None,
    typer.Option(
        "--simulated", metavar="FOLDER", help="Folder of `surefoot clips` to learn from too.", show_default=False
    ),
]
RunFolder = Annotated[
    Path | None,
    typer.Option(
        "--run-folder",
        metavar="FOLDER",
        help="Folder of the run's states and log; default: OUT.run.",
        show_default=False,
    ),
]
Logged = Annotated[
    bool | None,
    typer.Option(
        "--tensorboard/--no-tensorboard", help="Log to TensorBoard; default: where it is installed.", show_default=False
    ),
]


def train(
    data: DataOption = None,
    own: Annotated[
        Path | None, typer.Option("--own", metavar="FOLDER", help="Folder of your own recordings to learn from too.")
    ] = None,
    clips: Simulated = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.safetensors", help="Checkpoint to write.")] = Path(
        "surefoot.safetensors"
    ),
    force: ForceOption = False,
    seed: SeedOption = 0,
    recipe: Annotated[
        RecipeName, typer.Option(help="Networks and how they learn: the shipped ones, or others.")
    ] = RecipeName.SUREFOOT,
    epochs: Epochs = None,
    folds: Folds = 5,
    evaluated: Annotated[
        Path | None,
        typer.Option(
            "--evaluation",
            metavar="FILE.json",
            help="JSON of `surefoot evaluate`: calibration and metrics for the checkpoint.",
        ),
    ] = None,
    run_folder: RunFolder = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget an unfinished run in that folder.")] = False,
    device: Annotated[str, typer.Option(help="Where to compute: cpu, cuda, cuda:1.")] = "cpu",
    logged: Logged = None,
    quick: Quick = False,
) -> None:
    """Fit the networks to every recording and write a checkpoint.

    After a kill, the same command goes on where the run was, and ends with the very weights it would have had.

    Example: surefoot train --own recordings --evaluation runs/evaluation.json --out mine.safetensors

    With simulated people: surefoot train --simulated runs/clips

    On several GPUs: torchrun --nproc-per-node 2 --no-python surefoot train --device cuda
    """
    folder = data_folder(data)
    for file in FILES:
        if file.needed:
            required(folder, file.path)
    plan = plan_for(recipe, seed, quick, epochs)
    measured = None if evaluated is None else production.read_evaluation(evaluated, plan)
    require_writable(out, "--out")
    if out.exists() and not force:
        raise SurefootError(f"--out {out}: the name is taken; --force replaces it")
    plan = plan if clips is None or quick else plan.larger(WITH_SIMULATED)
    _one_thread()
    with joined(_device(device)) as (team, place):
        settings = _settings(plan, folds, seed, measured, own, clips, team, place)
        with closing(Journal(run_folder or Path(f"{out}.run"), settings, team, fresh)) as journal:
            if journal.begun:
                note(f"going on with the run in {journal.folder}")
            acted = () if clips is None else simulated.read(clips)
            corpus = read_corpus(folder, plan.mocap_clips, seed, _own(own), acted)
            with _log(logged, journal, team) as log, progress_bars(team.leads) as progress:
                run = Run(place, team, journal, log)
                made = production.make_checkpoint(corpus, plan, folds, seed, measured, progress, run)
            if team.leads:
                checkpoint.save(made, out)
                journal.finish()
                note(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _settings(
    plan: Plan,
    folds: int,
    seed: int,
    measured: Mapping[str, Any] | None,
    own: Path | None,
    clips: Path | None,
    team: Team,
    device: torch.device,
) -> dict[str, Any]:
    """What the result depends on beside the data, whose fingerprint each fit keeps."""
    return {
        "plan": asdict(plan),
        "folds": folds,
        "seed": seed,
        "evaluation": None if measured is None else zlib.crc32(json.dumps(measured, sort_keys=True).encode()),
        "own": None if own is None else str(own.resolve()),
        "simulated": None if clips is None else str(clips.resolve()),
        "processes": team.size,
        "device": device.type,
        "surefoot": version("surefoot"),
        "torch": torch.__version__,
    }


def _own(folder: Path | None) -> tuple[Track, ...]:
    """Read the user's recordings.

    Raises:
        SourceError: something there cannot be used; everything is named.
    """
    if folder is None:
        return ()
    found = read_own(folder, CleaningConfig())
    if found.problems:
        raise SourceError("; ".join(found.problems))
    return found.tracks


def _device(name: str) -> torch.device:
    """Return the device of that name.

    Raises:
        SurefootError: there is none.
    """
    try:
        device = torch.device(name)
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError) as error:  # torch asserts that it was built with CUDA
        raise SurefootError(f"no device '{name}': {str(error).splitlines()[0]} (--device cpu, cuda, cuda:1)") from error
    if device.type == "cuda":
        torch.backends.cudnn.benchmark = False  # it may choose other kernels, and so other sums, in every process
        torch.backends.cudnn.deterministic = True
    return device


@contextmanager
def _log(wanted: bool | None, journal: Journal, team: Team) -> Iterator[Log | None]:
    """Open the log of the leading process; without TensorBoard, say so, unless nobody wanted it."""
    if wanted is None and not available() and team.leads:
        note("no log: TensorBoard is not installed (pip install 'surefoot[train]')")
    if not team.leads or wanted is False or (wanted is None and not available()):
        yield None
        return
    log = Log(journal.folder / "log")
    try:
        yield log
    finally:
        log.close()


def _one_thread() -> None:
    """More threads give other sums, and on a busy machine no speed."""
    torch.set_num_threads(1)
