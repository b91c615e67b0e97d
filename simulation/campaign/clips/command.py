"""`surefoot clips`: simulated people as the camera on the walker sees them, to train on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from bridge.command_line.options import ConfigOption, JobsOption, SeedOption, SetOption
from bridge.command_line.output import note, progress
from bridge.config.load import load_config
from simulation.campaign.clips.job import ClipJob, perform_clip
from simulation.campaign.clips.store import Clips
from simulation.campaign.workers import work

CLIPS_SEED: Final = 9715517  # another one than any campaign's


def clips(
    falls: Annotated[int, typer.Option(min=0, help="Falls to record.")] = 300,
    non_falls: Annotated[int, typer.Option(min=0, help="Non-falls to record.")] = 200,
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder of the clips; a stopped run goes on there.")
    ] = Path("runs/clips"),
    seed: SeedOption = CLIPS_SEED,
    jobs: JobsOption = 1,
    config: ConfigOption = None,
    set_: SetOption = None,
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
    columns = (TextColumn("clips"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with progress(*columns, transient=False) as bar:
        task = bar.add_task("clips", total=len(wanted), completed=len(wanted) - len(missing))
        for told in work(perform_clip, missing, jobs):
            store.tell(told)
            bar.advance(task)
    note(f"{len(wanted)} clips in {out}")
    return 0
