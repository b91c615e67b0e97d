"""`surefoot codegen`: the MPC of a configuration as C."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bridge.command_line.options import ConfigOption, SetOption
from bridge.command_line.output import note, status
from bridge.config.load import load_config
from controller.mpc.export.writer import export


def codegen(
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder to write; must not exist yet, or be empty.")
    ],
    config: ConfigOption = None,
    set_: SetOption = None,
) -> int:
    """Write the MPC as C for a target without Python: model, problem, OSQP, checks, and a small `main`.

    Example: surefoot codegen --out build/mpc
    """
    loaded = load_config(config, set_ or [])
    with status("generating C"):
        export(loaded, out)
    note(f"{out}: build it with the line in {out / 'README.md'}")
    return 0
