"""`surefoot up`: the options, the checks before anything starts, and the exit code."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from bridge.command_line import completion
from bridge.command_line.options import (
    ConfigOption,
    ControllerOption,
    CropOption,
    DurationOption,
    SetOption,
    SourceOption,
)
from bridge.command_line.output import STDOUT, note
from bridge.config.load import load_config
from bridge.errors import ConfigError
from bridge.exit_codes import ExitCode
from bridge.launch.display import Display, JsonLines, Lines, Screen, Several
from bridge.launch.launcher import Launcher, ProcessState
from bridge.launch.ports import require_free
from bridge.launch.watch import Limits, watch_over


def up(
    source: SourceOption = None,
    crop: CropOption = None,
    estimator: Annotated[
        str | None,
        typer.Option(metavar="NAME", autocompletion=completion.estimators, help="movenet, yolo or FILE.py:NAME."),
    ] = None,
    controller: ControllerOption = None,
    log: Annotated[str | None, typer.Option(metavar="FILE", help="What the logging controller writes.")] = None,
    roles: Annotated[
        str | None,
        typer.Option(metavar="ROLE,...", autocompletion=completion.roles, help="Start only these roles here."),
    ] = None,
    duration: DurationOption = None,
    keep_running: Annotated[bool, typer.Option("--keep-running", help="Go on when the source is at its end.")] = False,
    no_screen: Annotated[bool, typer.Option("--no-screen", help="One line a second instead of the screen.")] = False,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: Annotated[
        Path | None,
        typer.Option(
            "--json", metavar="FILE", help="Write a JSON record a second, one a line; - for stdout, instead of text."
        ),
    ] = None,
) -> int:
    """Run perception, anticipation, controller and drive, and watch over them.

    Ends by itself, with exit code 0, when the source is at its end and the controller holds the
    safe stop. Ctrl-C, SIGTERM and SIGHUP stop every process and end with exit code 0. Exit code 1: a process
    died and was given up.

    Example: surefoot up --source clip.npz:walk --controller log --json runs/up.jsonl
    """
    overrides = [*(set_ or []), *_roles_override(roles)]
    loaded = load_config(config, overrides)
    options = {
        "perception": _given(source=source, crop=crop, estimator=estimator),
        "controller": _given(controller=controller, log=log),
    }
    _require_started(options, loaded.launch.roles)
    display = _display(json, no_screen=no_screen)
    require_free(loaded.bridge.endpoints, loaded.launch.roles)
    log_dir = Path(loaded.launch.log_dir)
    with Launcher(loaded, config, overrides, options, log_dir) as launcher:
        given_up = watch_over(launcher, loaded, display, Limits(duration, keep_running))
    for process in given_up:
        _say_given_up(process, log_dir)
    return ExitCode.CHECK_FAILED if given_up else ExitCode.DONE


def _display(json: Path | None, *, no_screen: bool) -> Display:
    if json == STDOUT:
        return JsonLines(json)
    shown = Lines() if no_screen or not sys.stdout.isatty() else Screen()
    return shown if json is None else Several(shown, JsonLines(json))


def _roles_override(roles: str | None) -> Iterable[str]:
    if roles is not None:
        yield f"launch.roles={[role.strip() for role in roles.split(',') if role.strip()]}"


def _given(**options: str | None) -> dict[str, str]:
    return {name: str(value) for name, value in options.items() if value is not None}


def _require_started(options: dict[str, dict[str, str]], roles: tuple[str, ...]) -> None:
    for role, given in options.items():
        if given and role not in roles:
            raise ConfigError(f"--{next(iter(given))} is for {role}, which is not started here ({', '.join(roles)})")


def _say_given_up(process: ProcessState, log_dir: Path) -> None:
    code = process.exit_code
    how = f"was killed by signal {-code}" if code is not None and code < 0 else f"died with exit code {code}"
    again = f" after {process.restarts} restarts" if process.restarts else ""
    note(f"surefoot: {process.role} {how}{again} and was given up; see {log_dir / process.role}.log")
