"""A chapter for each command of `surefoot`, from the command line itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer
from table import row

from bridge.cli import COMMANDS, _app


def command_reference() -> str:
    """Return what `--help` says of every command: usage, purpose, arguments, options, defaults, example."""
    return "\n".join(part for name in COMMANDS for part in _command(name))


def _command(name: str) -> Iterator[str]:
    whole = typer.main.get_command(_app([name]))
    command: Any = whole.commands[name]  # type: ignore[attr-defined]
    below = getattr(command, "commands", None)
    if below is None:
        yield _chapter(f"surefoot {name}", command, "##")
        return
    yield f"## `surefoot {name}`\n\n{COMMANDS[name].purpose}\n"
    for child in below:
        yield _chapter(f"surefoot {name} {child}", below[child], "###")


def _chapter(path: str, command: Any, level: str) -> str:
    context = command.make_context(path, [], resilient_parsing=True)
    usage = " ".join(command.collect_usage_pieces(context))
    said = "\n\n".join(part for part in (command.help or "", command.epilog or "") if part)
    rows = [_row(parameter, context) for parameter in command.get_params(context) if parameter.name != "help"]
    table = "| | meaning |\n|---|---|\n" + "\n".join(rows) if rows else ""
    return f"{level} `{path}`\n\n```text\n{path} {usage}\n```\n\n{_described(said)}\n\n{table}\n"


def _described(text: str) -> str:
    """Return help text with its example as code."""
    paragraphs = []
    for paragraph in text.replace("\b", "").split("\n\n"):
        flat = " ".join(paragraph.split())
        word, colon, rest = flat.partition(":")
        paragraphs.append(f"Example: `{rest.strip()}`" if word == "Example" and colon else flat)
    return "\n\n".join(paragraphs)


def _row(parameter: Any, context: Any) -> str:
    words, meaning = parameter.get_help_record(context)
    return row((f"`{' '.join(words.split())}`", " ".join(meaning.split())))
