"""The line on stderr that says how far something is."""

from __future__ import annotations

import sys
import time
from typing import Final, TextIO

TERMINAL_PERIOD_S: Final = 0.5
FILE_PERIOD_S: Final = 5.0


class Meter:
    """Writes one line: over itself on a terminal, again and again elsewhere, in each case not too often."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._period_s = TERMINAL_PERIOD_S if self._terminal else FILE_PERIOD_S
        self._due_s = time.monotonic() + self._period_s
        self._width = 0

    def due(self) -> bool:
        """Whether it is time for the next line."""
        return time.monotonic() >= self._due_s

    def show(self, text: str) -> None:
        """Write the line."""
        self._due_s = time.monotonic() + self._period_s
        end = "" if self._terminal else "\n"
        start = "\r" if self._terminal else ""
        self._stream.write(f"{start}{text.ljust(self._width)}{end}")
        self._stream.flush()
        self._width = len(text) if self._terminal else 0

    def end(self) -> None:
        """Leave the line on the terminal."""
        if self._width:
            self._stream.write("\n")
            self._stream.flush()
            self._width = 0
