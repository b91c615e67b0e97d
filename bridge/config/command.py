"""`surefoot config`: the whole configuration file, to start one's own from; checked, and brought up to date."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bridge.command_line.options import ForceOption, JsonOption
from bridge.command_line.output import STDOUT, note, require_writable, result, result_text, write_json, write_text
from bridge.config.load import load_config, parse_config, parse_text, read_text
from bridge.config.surefoot import SurefootConfig
from bridge.config.template import render_template
from bridge.config.version import VERSION, migrated_text, version_of
from bridge.errors import ConfigError


def config(
    check: Annotated[
        Path | None, typer.Option("--check", metavar="FILE", help="Check this file instead; say what is wrong with it.")
    ] = None,
    migrate: Annotated[
        Path | None,
        typer.Option("--migrate", metavar="FILE", help="Give this file in the present version, with its comments."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write the file here instead of to stdout.")
    ] = None,
    force: ForceOption = False,
    json: JsonOption = None,
) -> None:
    """Print a configuration file with every key, its default and its meaning.

    With --check or --migrate that of a file of yours. --json gives the values: the defaults, or with --check those
    of the file.

    Example: surefoot config --out my.toml

    An old file: surefoot config --migrate my.toml --out my.toml --force
    """
    if check is not None and migrate is not None:
        raise ConfigError("--check and --migrate do not go together: --migrate checks what it writes")
    if check is not None:
        if out is not None:
            raise ConfigError("--out does not go with --check: nothing is written")
        _check(check, json)
        return
    if json is not None:
        write_json(json, SurefootConfig().model_dump())
    if json == STDOUT:
        return
    text = render_template() if migrate is None else _migrated(migrate)
    if out is None:
        result_text(text)
        return
    require_writable(out, "--out")
    if out.exists() and not force:
        raise ConfigError(f"--out {out}: the name is taken; --force replaces it")
    write_text(out, text, "--out")


def _check(file: Path, json: Path | None) -> None:
    loaded = load_config(file)
    if json is not None:
        write_json(json, loaded.model_dump())
    if json != STDOUT:
        result(f"{file}: valid")


def _migrated(file: Path) -> str:
    """Return the text of `file` in the present version.

    Raises:
        ConfigError: it cannot be read, or what comes out does not hold.
    """
    old, name = read_text(file), str(file)
    version = version_of(parse_text(old, name), name)
    text, changes = migrated_text(old, name)
    parse_config(parse_text(text, name), f"{file}, migrated to version {VERSION}")
    note(*(f"{file}: {change}" for change in changes))
    note(f"{file}: " + ("is of the present version" if version == VERSION else f"version {version} -> {VERSION}"))
    return text
