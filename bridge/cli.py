"""`surefoot`: every command in one table, loaded when it is run.

Commands live in the packages they belong to and are named by strings, so that the
bridge imports no other package and `surefoot --help` loads no network library.
A command is a function with typer annotations, its options taken from `bridge.command_line.options` where others
have them too; the number it returns is the exit code (`bridge.exit_codes`).
"""

from __future__ import annotations

import importlib
import os
import select
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.metadata import version
from typing import Annotated, Any, Final, NamedTuple

import typer

from bridge.command_line import completion
from bridge.errors import SurefootError
from bridge.exit_codes import MEANINGS, ExitCode


class Command(NamedTuple):
    """Where a command is found and what it is for."""

    target: str  # module:function
    purpose: str  # one line
    panel: str = "Commands"  # of the list of commands


RUN: Final = "Run"
LOOK: Final = "Record and look"
TUNE: Final = "Set up and tune"
MAKE: Final = "Simulate, train, export"

COMMANDS: Final = {
    "up": Command("bridge.launch.command:up", "Run the processes and watch over them.", RUN),
    "rehearse": Command("bridge.launch.rehearse:rehearse", "Run it all on a recorded stumble, without physics.", RUN),
    "demo": Command("simulation.trial.command:demo", "A simulated person is pushed, with help and without.", RUN),
    "router": Command("bridge.launch.router:router", "Join the processes of several machines.", RUN),
    "record": Command("bridge.record.record_command:record", "Record what is on the wire into an MCAP file.", LOOK),
    "info": Command("bridge.record.info_command:info", "Say what is in a recording, also one that was cut off.", LOOK),
    "replay": Command("bridge.record.replay_command:replay", "Replay a recording to everyone or to one process.", LOOK),
    "view": Command("bridge.view.command:view", "Look at what runs, or at a recording, in Rerun.", LOOK),
    "assess": Command(
        "bridge.assess.command:assess", "Assess keypoint clips offline with the code that runs live.", LOOK
    ),
    "latency": Command(
        "bridge.latency.command:latency", "Measure newest frame to command on the wire, hop by hop.", LOOK
    ),
    "doctor": Command("bridge.doctor.command:doctor", "Say what is wrong on this machine and how to mend it.", TUNE),
    "config": Command(
        "bridge.config.command:config", "Print a configuration file with every key and its meaning.", TUNE
    ),
    "keys": Command("bridge.keys.command:keys", "Make and look at the certificates of the roles.", TUNE),
    "tune": Command(
        "controller.tuning.command:tune", "Find thresholds by replaying recordings; see the trade-off.", TUNE
    ),
    "personalise": Command(
        "controller.personal.command:personalise",
        "Find the mass and damping that one person likes, by comparisons.",
        TUNE,
    ),
    "campaign": Command(
        "simulation.campaign.command:campaign", "Hundreds of simulated falls: no help, reactive, anticipatory.", MAKE
    ),
    "clips": Command(
        "simulation.campaign.clips.command:clips", "Record simulated falls and daily deeds to train on.", MAKE
    ),
    "data": Command("anticipation.training.data_command:data", "List and check the data there is to train on.", MAKE),
    "train": Command("anticipation.training.commands:train", "Train the anticipation networks.", MAKE),
    "evaluate": Command(
        "anticipation.training.evaluation.command:evaluate", "Measure the anticipation, split by sequence.", MAKE
    ),
    "export": Command("anticipation.export_command:export", "Write the networks as an ONNX graph.", MAKE),
    "codegen": Command("controller.mpc.export.command:codegen", "Write the MPC as C for a real-time target.", MAKE),
}

_usage_error = typer.BadParameter.__base__  # typer names only this one of its usage errors
assert _usage_error is not None
USAGE_ERROR: Final[Any] = _usage_error

EPILOG: Final = "\n\n".join(
    [
        "Example: surefoot up --source clip.npz:walk",
        "The result goes to stdout, everything else to stderr.",
        "Exit codes:",
        *(f"**{code.value}** {meaning}" for code, meaning in MEANINGS.items()),
    ]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    asked = completion.asked_words() if arguments is None else None
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    code: int
    try:
        if asked is not None:
            print(completion.answer(lambda: _run(asked)), end="")  # noqa: T201 (what the shell asked for)
            code = ExitCode.DONE
        else:
            code = _run(words)
        sys.stdout.flush()  # a pipe that nobody reads any more is found here, not at the interpreter's end
    except SurefootError as error:
        _say(str(error))
        code = error.exit_code
    except USAGE_ERROR as error:
        command, said = error.ctx.command_path if error.ctx is not None else "surefoot", error.format_message()
        code = ExitCode.BAD_INPUT if said else ExitCode.DONE  # a group without a command has shown its help
        if said:
            _say(f"{said} (see {command} --help)")
    except (KeyboardInterrupt, typer.Abort):
        code = ExitCode.INTERRUPTED
    except Exception as error:  # noqa: BLE001 (the last to know: a fault has an exit code of its own)
        code = ExitCode.READER_GONE if _reader_gone(error) else ExitCode.FAULT
        if code is ExitCode.FAULT:
            traceback.print_exc()
            _say(f"this is a fault of Surefoot, please report it with the lines above: {error}")
    return code


def _run(words: Sequence[str]) -> int:
    try:
        result = _app(words)(words, prog_name="surefoot", standalone_mode=False)
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # the answer of typer and of rich, who leave stdout quiet
            return ExitCode.READER_GONE
        result = end.code
    return result if isinstance(result, int) else ExitCode.DONE


def _app(words: Sequence[str]) -> typer.Typer:
    """Return the application with only the command loaded that `words` ask for."""
    app = typer.Typer(name="surefoot", pretty_exceptions_enable=False, rich_markup_mode="markdown", epilog=EPILOG)
    app.callback()(_surefoot)
    wanted = next((word for word in words if not word.startswith("-")), None)
    for name, command in COMMANDS.items():
        loaded = _load(command.target) if name == wanted else _not_loaded
        if isinstance(loaded, typer.Typer):  # a command with commands of its own
            app.add_typer(loaded, name=name, short_help=command.purpose, rich_help_panel=command.panel)
        else:
            app.command(name, short_help=command.purpose, rich_help_panel=command.panel)(loaded)
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


def _reader_gone(error: Exception) -> bool:
    """Whether `error` comes from a stdout that nobody reads any more; if so, nothing is written there again."""
    if not isinstance(error, BrokenPipeError):
        return False
    with suppress(OSError, ValueError):
        watched = select.poll()
        watched.register(sys.stdout.fileno(), 0)  # errors alone are told
        if watched.poll(0):
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, sys.stdout.fileno())
            os.close(silence)
            return True
    return False


def _say(text: str) -> None:
    print(f"surefoot: {' '.join(text.split())}", file=sys.stderr)  # noqa: T201 (the one line a user reads)


if __name__ == "__main__":
    raise SystemExit(main())
