"""`surefoot assess`: what the system would have made of recorded keypoints."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.progress import BarColumn, TimeRemainingColumn

from bridge.assess.clips import Clip, read_clips
from bridge.assess.run import Assessment, assess_clip
from bridge.clock import NS
from bridge.command_line.options import ConfigOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, progress, require_writable, result, status, write_json
from bridge.config.load import load_config
from bridge.errors import SurefootError


def assess(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings with NAME/keypoints and NAME/fps.", metavar="FILE.npz...")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.npz", help="Where the results go.")],
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for a picture of each clip, with the thresholds drawn in."),
    ] = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> None:
    """Run recorded keypoints through perception, anticipation and intervention, as fast as it goes.

    Example: surefoot assess clips.npz --config config/surefoot.toml --out results.npz --plot pictures
    """
    if out.suffix != ".npz":
        raise SurefootError(f"--out {out}: expected a file name ending in .npz")
    if not out.parent.is_dir():
        raise SurefootError(f"--out {out}: no such folder: {out.parent}")
    if json is not None:
        require_writable(json)
    parsed = load_config(config, set_ or [])
    clips = read_clips(files, parsed.perception.source)
    results: dict[str, Assessment] = {}
    with progress("{task.description}", BarColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("assessing", total=sum(len(clip.stamps_ns) for clip in clips))
        for clip in clips:
            bar.update(task, description=clip.name)
            results[clip.name] = assess_clip(clip, parsed)
            bar.advance(task, len(clip.stamps_ns))
    write_results(results, out)
    if plot is not None:
        from bridge.assess.plot import write_plots  # noqa: PLC0415 (matplotlib is loaded only where it draws)

        with status("drawing"):
            write_plots(results, {clip.name: np.array(clip.stamps_ns) / NS for clip in clips}, parsed, plot)
    told = [_told(clip, results[clip.name]) for clip in clips]
    if json is not None:
        write_json(json, {"results": out, "clips": told})
    if json != STDOUT:
        result(*(_line(row) for row in told))


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


class _Told(NamedTuple):
    """What is said of one clip."""

    name: str
    frames: int
    states: list[str]  # in order of first appearance
    peak_stiffening: float  # NaN where there was never one


def _told(clip: Clip, assessed: Assessment) -> _Told:
    states = list(dict.fromkeys(assessed.state.tolist()))
    peak = np.nanmax(assessed.stiffening) if np.isfinite(assessed.stiffening).any() else np.nan
    return _Told(clip.name, len(clip.stamps_ns), states, float(peak))


def _line(told: _Told) -> str:
    return f"{told.name}: {told.frames} frames, {' -> '.join(told.states)}, peak stiffening {told.peak_stiffening:.2f}"
