"""`surefoot assess`: what the system would have made of recorded keypoints."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

from bridge.assess.clips import Clip, read_clips
from bridge.assess.run import Assessment, assess_clip
from bridge.clock import NS
from bridge.config.load import load_config
from bridge.errors import SurefootError


def assess(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings with NAME/keypoints and NAME/fps.", metavar="FILE.npz...")
    ],
    out: Annotated[Path, typer.Option(help="Where the results go (.npz).")],
    config: Annotated[Path | None, typer.Option(help="Configuration file; default: built-in values.")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Folder for a picture of each clip, with the thresholds drawn in.")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override one value; repeatable.")
    ] = None,
) -> None:
    """Run recorded keypoints through perception, anticipation and intervention, as fast as it goes.

    Example: surefoot assess clips.npz --config config/surefoot.toml --out results.npz --plot pictures
    """
    if out.suffix != ".npz":
        raise SurefootError(f"--out {out}: expected a file name ending in .npz")
    if not out.parent.is_dir():
        raise SurefootError(f"--out {out}: no such folder: {out.parent}")
    parsed = load_config(config, settings or [])
    clips = read_clips(files, parsed.perception.source)
    results: dict[str, Assessment] = {}
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("assessing", total=sum(len(clip.stamps_ns) for clip in clips))
        for clip in clips:
            progress.update(task, description=clip.name)
            results[clip.name] = assess_clip(clip, parsed)
            progress.advance(task, len(clip.stamps_ns))
    write_results(results, out)
    if plot is not None:
        from bridge.assess.plot import write_plots  # noqa: PLC0415 (matplotlib is loaded only where it draws)

        write_plots(results, {clip.name: np.array(clip.stamps_ns) / NS for clip in clips}, parsed, plot)
    typer.echo(_summary(clips, results))


def write_results(results: dict[str, Assessment], out: Path) -> None:
    """Write every clip's arrays to `out`, whole or not at all."""
    arrays = {f"{name}/{key}": value for name, result in results.items() for key, value in result._asdict().items()}
    part = out.with_name(out.name + ".part")
    try:
        with part.open("wb") as file:
            np.savez_compressed(file, **arrays)
            file.flush()
            os.fsync(file.fileno())
        part.replace(out)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SurefootError(f"--out {out}: cannot be written: {error}") from error


def _summary(clips: list[Clip], results: dict[str, Assessment]) -> str:
    lines = []
    for clip in clips:
        result = results[clip.name]
        states = sorted(set(result.state.tolist()), key=result.state.tolist().index)
        peak = np.nanmax(result.stiffening) if np.isfinite(result.stiffening).any() else float("nan")
        lines.append(f"{clip.name}: {len(clip.stamps_ns)} frames, {' -> '.join(states)}, peak stiffening {peak:.2f}")
    return "\n".join(lines)
