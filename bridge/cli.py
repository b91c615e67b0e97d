"""`surefoot`: every command in one table, loaded when it is run.

Commands live in the packages they belong to and are named by strings, so that the
bridge imports no other package and `surefoot --help` loads no network library.
A command is a function with typer annotations; the number it returns is the exit code.

Exit codes: 0 done, 1 something died that should have lived, 2 bad input (one line on
stderr says what), 130 interrupted.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Annotated, Any, Final, NamedTuple

import typer

from bridge.errors import SurefootError

INTERRUPTED = 130  # 128 + SIGINT, as shells report it


class Command(NamedTuple):
    """Where a command is found and what it is for."""

    target: str  # module:function
    purpose: str  # one line


COMMANDS: Final = {
    "up": Command("bridge.launch.command:up", "Run the processes and watch over them."),
    "codegen": Command("controller.mpc.export.command:codegen", "Write the MPC as C for a real-time target."),
    "config": Command("bridge.config.command:config", "Print a configuration file with every key and its meaning."),
    "demo": Command("simulation.trial.command:demo", "A simulated person is pushed, with help and without."),
    "rehearse": Command("bridge.launch.rehearse:rehearse", "Run it all on a recorded stumble, without physics."),
    "assess": Command("bridge.assess.command:assess", "Assess keypoint clips offline with the code that runs live."),
    "latency": Command("bridge.latency.command:latency", "Measure newest frame to command on the wire, hop by hop."),
    "record": Command("bridge.record.record_command:record", "Record what is on the wire into an MCAP file."),
    "info": Command("bridge.record.info_command:info", "Say what is in a recording, also one that was cut off."),
    "replay": Command("bridge.record.replay_command:replay", "Replay a recording to everyone or to one process."),
    "view": Command("bridge.view.command:view", "Look at what runs, or at a recording, in Rerun."),
    "keys": Command("bridge.keys.command:keys", "Make and look at the certificates of the roles."),
    "router": Command("bridge.launch.router:router", "Join the processes of several machines."),
    "data": Command("anticipation.training.data_command:data", "List and check the data there is to train on."),
    "train": Command("anticipation.training.commands:train", "Train the anticipation networks."),
    "export": Command("anticipation.export_command:export", "Write the networks as an ONNX graph."),
    "evaluate": Command(
        "anticipation.training.evaluation.command:evaluate", "Measure the anticipation, split by sequence."
    ),
    "campaign": Command(
        "simulation.campaign.command:campaign", "Hundreds of simulated falls: no help, reactive, anticipatory."
    ),
    "clips": Command("simulation.campaign.clips.command:clips", "Record simulated falls and daily deeds to train on."),
}

_usage_error = typer.BadParameter.__base__  # typer names only this one of its usage errors
assert _usage_error is not None
USAGE_ERROR: Final[Any] = _usage_error


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        result = _app(words)(words, prog_name="surefoot", standalone_mode=False)
    except SurefootError as error:
        _say(str(error))
        return error.exit_code
    except USAGE_ERROR as error:
        command = error.ctx.command_path if error.ctx is not None else "surefoot"
        _say(f"{error.format_message()} (see {command} --help)")
        return SurefootError.exit_code
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    return result if isinstance(result, int) else 0


def _app(words: Sequence[str]) -> typer.Typer:
    """Return the application with only the command loaded that `words` ask for."""
    app = typer.Typer(
        name="surefoot", add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown"
    )
    app.callback()(_surefoot)
    wanted = next((word for word in words if not word.startswith("-")), None)
    for name, command in COMMANDS.items():
        loaded = _load(command.target) if name == wanted else _not_loaded
        if isinstance(loaded, typer.Typer):  # a command with commands of its own
            app.add_typer(loaded, name=name, short_help=command.purpose)
        else:
            app.command(name, short_help=command.purpose)(loaded)
    return app


def _load(target: str) -> Callable[..., Any] | typer.Typer:
    module, _, function = target.partition(":")
    loaded: Callable[..., Any] | typer.Typer = getattr(importlib.import_module(module), function)
    return loaded


def _not_loaded() -> None:
    """Stand in for a command in the list of commands."""


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"surefoot {version('surefoot')}")  # noqa: T201 (what was asked for)
        raise typer.Exit


def _surefoot(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Walking assistance that sees a fall coming and is already stiff when it arrives."""


def _say(text: str) -> None:
    print(f"surefoot: {' '.join(text.split())}", file=sys.stderr)  # noqa: T201 (the one line a user reads)


if __name__ == "__main__":
    raise SystemExit(main())
