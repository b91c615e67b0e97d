"""Where a command's words go: the result to stdout, everything else to stderr.

Nothing else in the house writes to stdout, so that `surefoot ... > file` and `surefoot ... | program` hold the
result alone. On a terminal both are read. Colours are Rich's: none in a file or pipe, none with NO_COLOR set.
"""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from enum import Enum
from pathlib import Path, PurePath
from typing import Any, Final, NoReturn

import typer
from rich.console import Console
from rich.progress import Progress, ProgressColumn
from rich.status import Status

from bridge.errors import SurefootError

STDOUT: Final = Path("-")  # as the name of a file
WIDE: Final = 1000  # of a file or pipe: its reader folds lines, if anybody does


class _Console(Console):
    """A console that lets `main` decide what a closed pipe means."""

    def on_broken_pipe(self) -> NoReturn:
        raise BrokenPipeError


def result_console() -> Console:
    """Return the console of the result: as wide as the terminal, and without limit elsewhere."""
    return _Console(highlight=False, width=None if sys.stdout.isatty() else WIDE)


def note_console() -> Console:
    """Return the console of progress and remarks."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def result(*parts: Any) -> None:
    """Write tables or lines of text, as they are, to stdout."""
    console = result_console()
    for part in parts:
        console.print(part, markup=False, soft_wrap=isinstance(part, str))


def result_text(text: str) -> None:
    """Write `text` to stdout as it is, without a newline of its own."""
    typer.echo(text, nl=False)


def note(*lines: str) -> None:
    """Write lines that are not the result to stderr."""
    for line in lines:
        typer.echo(line, err=True)


def progress(*columns: str | ProgressColumn, transient: bool = True) -> Progress:
    """Return a progress display on stderr; it shows nothing where nobody looks."""
    return Progress(*columns, console=note_console(), transient=transient, disable=not sys.stderr.isatty())


def status(text: str) -> Status:
    """Return a context in which a spinner on stderr says that something takes long."""
    return note_console().status(text)


def write_json(file: Path, value: Any) -> None:
    """Write `value` as one JSON document: to stdout for `-`, else to `file`, whole or not at all.

    Numbers that are none (NaN, infinity) become null; named tuples become objects.

    Raises:
        SurefootError: the file cannot be written.
    """
    text = json.dumps(plain(value), indent=2, allow_nan=False) + "\n"
    if file == STDOUT:
        result_text(text)
    else:
        write_text(file, text, "--json")


def write_text(file: Path, text: str, option: str) -> None:
    """Write `text` to the file that `option` named, whole or not at all.

    Raises:
        SurefootError: it cannot be written.
    """
    temporary = ""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)  # mkstemp's 600 would hide it from others
        Path(temporary).replace(file)
    except OSError as error:
        raise SurefootError(f"{option} {file}: cannot be written: {error.strerror}") from error
    finally:
        if temporary:
            with suppress(OSError):
                Path(temporary).unlink()


def require_writable(file: Path, option: str = "--json") -> None:
    """Raise if `file` cannot be written, before time is spent on its content.

    Raises:
        SurefootError: its folder cannot be made or written, or the name is a folder's.
    """
    if file == STDOUT:
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SurefootError(f"{option} {file}: cannot be written: {error.strerror}: {error.filename}") from error
    if file.is_dir():
        raise SurefootError(f"{option} {file}: cannot be written: it is a folder")
    if not os.access(file.parent, os.W_OK):
        raise SurefootError(f"{option} {file}: cannot be written: no permission in {file.parent}")


def plain(value: Any) -> Any:
    """Return `value` as JSON can say it."""
    if isinstance(value, Enum):
        value = value.value
    elif isinstance(value, PurePath):
        value = str(value)
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
