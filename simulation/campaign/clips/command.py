"""`surefoot clips`: simulated people as the camera on the walker sees them, to train on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from bridge.config.load import load_config
from simulation.campaign.clips.job import ClipJob, perform_clip
from simulation.campaign.clips.store import Clips
from simulation.campaign.workers import work


def clips(
    falls: Annotated[int, typer.Option(min=0, help="Falls to record.")] = 300,
    non_falls: Annotated[int, typer.Option(min=0, help="Non-falls to record.")] = 200,
    jobs: Annotated[int, typer.Option(min=1, help="Clips at a time.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of everything drawn; another one than any campaign's.")] = 9715517,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the clips; a stopped run goes on there.")] = Path(
        "runs/clips"
    ),
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="Configuration; default: the defaults.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
    ] = None,
) -> int:
    """Record simulated falls and daily deeds through the camera on the walker, with the facts that label them.

    Keypoints with the detector's errors, and beside them when the disturbance showed, how far the body came down and
    what the harness carried. The walker helps in some clips, early, late or for nothing, and in others not at all.

    Example: surefoot clips --falls 300 --non-falls 200 --jobs 2 --out runs/clips
    """
    settings = load_config(config, set_ or [])
    store = Clips(out, {"seed": seed, "config": settings.model_dump_json()})
    wanted: list[ClipJob] = []
    for number in range(max(falls, non_falls)):
        wanted += [ClipJob("fall", number, seed, str(out), settings)] * (number < falls)
        wanted += [ClipJob("non_fall", number, seed, str(out), settings)] * (number < non_falls)
    missing = [job for job in wanted if not job.path.exists()]
    console = Console(stderr=True)
    columns = (TextColumn("clips"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not sys.stderr.isatty()) as progress:
        bar = progress.add_task("clips", total=len(wanted), completed=len(wanted) - len(missing))
        for told in work(perform_clip, missing, jobs):
            store.tell(told)
            progress.advance(bar)
    Console(highlight=False, soft_wrap=True).print(f"{len(wanted)} clips in {out}")
    return 0
