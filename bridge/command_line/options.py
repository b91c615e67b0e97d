"""The options that commands share: one name, one meaning, one wording everywhere.

A command that needs one takes it from here, so that `--config`, `--set`, `--out`, `--json`, `--force`, `--seed`,
`--jobs`, `--duration` and `--data` mean the same wherever they stand. docs/commands.md has the table.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer

from bridge.command_line import completion

DEFAULT_CONFIG: Final = Path("config/surefoot.toml")


class ControllerKind(StrEnum):
    """Controllers that can be asked for on the command line."""

    MPC = "mpc"
    LOG = "log"


def chosen_config(given: Path | None) -> Path | None:
    """Return the configuration file to use: the one given, or the one that lies where one is expected."""
    return given or (DEFAULT_CONFIG if DEFAULT_CONFIG.is_file() else None)


ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        callback=chosen_config,
        show_default=False,
        help=f"Configuration; default: {DEFAULT_CONFIG} if it is there, else built-in values.",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="SECTION.KEY=VALUE",
        autocompletion=completion.settings,
        show_default=False,
        help="Override a value of the configuration; repeatable.",
    ),
]
JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="FILE", show_default=False, help="Write the result as JSON; - for stdout, instead of text."
    ),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace what is there.")]
DurationOption = Annotated[
    float | None, typer.Option("--duration", min=0, metavar="S", show_default=False, help="Stop after this long [s].")
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, metavar="N", help="Seed of everything that is drawn.")]
JobsOption = Annotated[int, typer.Option("--jobs", min=1, metavar="N", help="How many at a time on this machine.")]
DataOption = Annotated[
    Path | None,
    typer.Option(
        "--data", envvar="SUREFOOT_DATA", metavar="FOLDER", show_default=False, help="Folder of the research data."
    ),
]
ControllerOption = Annotated[
    ControllerKind | None,
    typer.Option("--controller", show_default=False, help="mpc, or log: record what is asked."),
]
SourceOption = Annotated[
    str | None,
    typer.Option(
        "--source",
        metavar="SPEC",
        autocompletion=completion.clips,
        show_default=False,
        help="Keypoint file FILE.npz:CLIP, video file, image folder, camera, or code of your own: FILE.py:NAME.",
    ),
]
CropOption = Annotated[
    str | None,
    typer.Option("--crop", metavar="X,Y,W,H", show_default=False, help="Part of the image to look at [px]."),
]
TopicsOption = Annotated[
    str | None,
    typer.Option(
        "--topics",
        metavar="KEY,...",
        autocompletion=completion.topics,
        show_default=False,
        help="Only these topics, such as keypoints,fall_horizon.",
    ),
]
RecordingOut = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE.mcap",
        show_default=False,
        help="Where to; without .mcap: a rosbag2 folder of that name.",
    ),
]
RecordingArgument = Annotated[
    Path, typer.Argument(metavar="RECORDING", show_default=False, help="An .mcap file or a rosbag2 folder.")
]
