"""Command-line options that the recording commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bridge.launch.command import DEFAULT_CONFIG

ConfigOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help=f"Configuration; default: {DEFAULT_CONFIG} if it is there, else defaults."),
]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
]
OutOption = Annotated[
    Path | None, typer.Option(metavar="FILE.mcap", help="Where to; without .mcap: a rosbag2 folder of that name.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")]
TopicsOption = Annotated[
    str | None, typer.Option(metavar="KEY,...", help="Only these topics, such as keypoints,fall_horizon.")
]
FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="An .mcap file or a rosbag2 folder.")]


def config_path(given: Path | None) -> Path | None:
    """Return the configuration file to use, as `surefoot up` chooses it."""
    return given or (DEFAULT_CONFIG if DEFAULT_CONFIG.is_file() else None)
