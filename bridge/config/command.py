"""`surefoot config`: the whole configuration file, to start one's own from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bridge.config.load import load_config
from bridge.config.template import render_template


def config(
    check: Annotated[Path | None, typer.Option(help="Check this file instead; say what is wrong with it.")] = None,
) -> None:
    """Print a configuration file with every key, its default and its meaning.

    Example: surefoot config > my.toml
    """
    if check is None:
        typer.echo(render_template(), nl=False)
        return
    load_config(check)
    typer.echo(f"{check}: valid")
