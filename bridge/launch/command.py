"""`surefoot up`: the options, the checks before anything starts, and the exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer

from bridge.config.load import load_config
from bridge.errors import ConfigError
from bridge.launch.display import Display, Lines, Screen
from bridge.launch.launcher import Launcher, ProcessState
from bridge.launch.ports import require_free
from bridge.launch.watch import Limits, watch_over

DEFAULT_CONFIG: Final = Path("config/surefoot.toml")
GAVE_UP = 1


class ControllerKind(StrEnum):
    """Controllers that can be asked for on the command line."""

    MPC = "mpc"
    LOG = "log"


def up(
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help=f"Configuration; default: {DEFAULT_CONFIG} if it is there, else defaults."),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(metavar="SPEC", help="Keypoint file FILE.npz:CLIP, video file, image folder or camera."),
    ] = None,
    crop: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Part of the image to look at [px].")] = None,
    estimator: Annotated[str | None, typer.Option(metavar="NAME", help="Pose estimator: movenet or yolo.")] = None,
    controller: Annotated[ControllerKind | None, typer.Option(help="mpc, or log: record what is asked.")] = None,
    log: Annotated[str | None, typer.Option(metavar="FILE", help="What the logging controller writes.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
    ] = None,
    roles: Annotated[str | None, typer.Option(metavar="ROLE,...", help="Start only these roles here.")] = None,
    duration: Annotated[float | None, typer.Option(min=0, metavar="S", help="Stop after this long [s].")] = None,
    keep_running: Annotated[bool, typer.Option("--keep-running", help="Go on when the source is at its end.")] = False,
    no_screen: Annotated[bool, typer.Option("--no-screen", help="One line a second instead of the screen.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON record a second instead of the screen.")] = False,
) -> int:
    """Run perception, anticipation, controller and drive, and watch over them.

    Ends by itself, with exit code 0, when the source is at its end and the controller holds the
    safe stop. Ctrl-C, SIGTERM and SIGHUP stop every process and end with exit code 0. Exit code 2: bad
    input, said on one line. Exit code 1: a process died and was given up.
    """
    path = config or (DEFAULT_CONFIG if DEFAULT_CONFIG.is_file() else None)
    overrides = [*(set_ or []), *_roles_override(roles)]
    loaded = load_config(path, overrides)
    options = {
        "perception": _given(source=source, crop=crop, estimator=estimator),
        "controller": _given(controller=controller, log=log),
    }
    _require_started(options, loaded.launch.roles)
    require_free(loaded.bridge.endpoints, loaded.launch.roles)
    display: Display = Lines(as_json=as_json) if as_json or no_screen or not sys.stdout.isatty() else Screen()
    log_dir = Path(loaded.launch.log_dir)
    with Launcher(loaded, path, overrides, options, log_dir) as launcher:
        given_up = watch_over(launcher, loaded, display, Limits(duration, keep_running))
    for process in given_up:
        _say_given_up(process, log_dir)
    return GAVE_UP if given_up else 0


def _roles_override(roles: str | None) -> Iterable[str]:
    if roles is not None:
        yield f"launch.roles={json.dumps([role.strip() for role in roles.split(',') if role.strip()])}"


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
    line = f"surefoot: {process.role} {how}{again} and was given up; see {log_dir / process.role}.log"
    print(line, file=sys.stderr)  # noqa: T201 (the one line a user reads)
