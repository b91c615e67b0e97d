"""Showing the running system: on a terminal, line by line, or as JSON lines."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Protocol, Self

from rich.console import Console
from rich.live import Live

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
        self._live = Live(console=Console(), auto_refresh=False)
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
    """One line a second, of text or of JSON."""

    def __init__(self, *, as_json: bool) -> None:
        self._as_json = as_json
        self._due_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Print a line when it is due."""
        if elapsed_s < self._due_s:
            return
        self._due_s = elapsed_s + LINE_PERIOD_S
        if self._as_json:
            self._print(json.dumps(screen.record(elapsed_s, processes, view)))
        else:
            self._print(screen.line(elapsed_s, processes, view))

    def say(self, elapsed_s: float, text: str) -> None:
        """Print `text`; as JSON it is the record's `event`."""
        self._due_s = elapsed_s
        record = {"elapsed_s": round(elapsed_s, 3), "event": text}
        self._print(json.dumps(record) if self._as_json else f"{elapsed_s:6.1f} s  {text}")

    def _print(self, text: str) -> None:
        print(text, file=sys.stdout, flush=True)  # noqa: T201 (what the user asked for)
