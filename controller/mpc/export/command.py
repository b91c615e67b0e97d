"""`surefoot codegen`: the MPC of a configuration as C."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bridge.config.load import load_config
from controller.mpc.export.writer import export


def codegen(
    out: Annotated[Path, typer.Option("--out", help="Folder to write; must not exist yet, or be empty.")],
    config: Annotated[Path | None, typer.Option("--config", help="Configuration file (TOML).")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", help="One key: SECTION.KEY=VALUE.")] = None,
) -> int:
    """Write the MPC as C for a target without Python: model, problem, OSQP, checks, and a small `main`.

    Example: `surefoot codegen --out build/mpc`
    """
    loaded = load_config(config, overrides or [])
    console = Console(stderr=True)
    with console.status("generating C"):
        export(loaded, out)
    console.print(f"{out}: build it with the line in {out / 'README.md'}", highlight=False)
    return 0
