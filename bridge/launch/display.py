"""Showing the running system: on a terminal, line by line, or as JSON lines."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol, Self, TextIO

from rich.live import Live

from bridge.command_line.output import STDOUT, require_writable, result_console
from bridge.errors import SurefootError
from bridge.launch import screen
from bridge.launch.launcher import ProcessState
from bridge.launch.monitor import View

LINE_PERIOD_S = 1.0
SCREEN_PERIOD_S = 0.25


class Display(Protocol):
    """Something that shows how things are, as often as suits it."""

    def __enter__(self) -> Self:
        """Take the terminal."""
        ...

    def __exit__(self, *error: object) -> None:
        """Give it back."""
        ...

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Show the state; called more often than it need be shown."""
        ...

    def say(self, elapsed_s: float, text: str) -> None:
        """Tell of something that happened; the next `show` shows."""
        ...


class Screen:
    """A table that is drawn over itself."""

    def __init__(self) -> None:
        self._live = Live(console=result_console(), auto_refresh=False)
        self._due_s = 0.0
        self._notice = ""

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Draw the table again when it is due."""
        if elapsed_s >= self._due_s:
            self._due_s = elapsed_s + SCREEN_PERIOD_S
            self._live.update(screen.table(elapsed_s, processes, view, self._notice), refresh=True)

    def say(self, elapsed_s: float, text: str) -> None:
        """Show `text` below the table from the next drawing on."""
        self._notice, self._due_s = text, elapsed_s


class Lines:
    """One line of text a second."""

    def __init__(self) -> None:
        self._due_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Print a line when it is due."""
        if elapsed_s >= self._due_s:
            self._due_s = elapsed_s + LINE_PERIOD_S
            _write(sys.stdout, screen.line(elapsed_s, processes, view))

    def say(self, elapsed_s: float, text: str) -> None:
        """Print `text`."""
        self._due_s = elapsed_s
        _write(sys.stdout, f"{elapsed_s:6.1f} s  {text}")


class JsonLines:
    """One JSON record a second and one for each event, one a line; `-` is stdout."""

    def __init__(self, file: Path) -> None:
        """Prepare, but write nothing.

        Raises:
            SurefootError: the file cannot be written.
        """
        require_writable(file)
        self._file, self._due_s = file, 0.0
        self._stream: TextIO = sys.stdout

    def __enter__(self) -> Self:
        if self._file != STDOUT:
            try:
                self._stream = self._file.open("w", encoding="utf-8")
            except OSError as error:
                raise SurefootError(f"--json {self._file}: cannot be written: {error.strerror}") from error
        return self

    def __exit__(self, *error: object) -> None:
        if self._file != STDOUT:
            self._stream.close()

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Write a record when it is due."""
        if elapsed_s >= self._due_s:
            self._due_s = elapsed_s + LINE_PERIOD_S
            _write(self._stream, json.dumps(screen.record(elapsed_s, processes, view)))

    def say(self, elapsed_s: float, text: str) -> None:
        """Write `text` as the record's `event`."""
        self._due_s = elapsed_s
        _write(self._stream, json.dumps({"elapsed_s": round(elapsed_s, 3), "event": text}))


class Several:
    """Displays side by side."""

    def __init__(self, *displays: Display) -> None:
        self._displays = displays
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        for display in self._displays:
            self._stack.enter_context(display)
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Let each of them show the state."""
        for display in self._displays:
            display.show(elapsed_s, processes, view)

    def say(self, elapsed_s: float, text: str) -> None:
        """Let each of them tell it."""
        for display in self._displays:
            display.say(elapsed_s, text)


def _write(stream: TextIO, line: str) -> None:
    stream.write(f"{line}\n")
    stream.flush()
