"""Where a launched process writes what it has to say."""

from __future__ import annotations

import os
from pathlib import Path

from bridge.errors import ConfigError

LIMIT_BYTES = 1 << 20
_TAIL_BYTES = 4096


class LogFile:
    """The log of one role; older text moves to `ROLE.log.1` before it grows large.

    The process writes straight to the file: a launcher that hangs can never block a
    control loop on a full pipe. The file is opened for appending, so it may be
    emptied under the writer.
    """

    def __init__(self, folder: Path, role: str, limit_bytes: int = LIMIT_BYTES) -> None:
        self.path = folder / f"{role}.log"
        self._limit_bytes = limit_bytes
        self._start = 0  # where the current process began to write
        self._seen = (-1, -1)
        self._lines: list[str] = []

    def open(self) -> int:
        """Return a file descriptor for a new process; the caller closes its copy.

        Raises:
            ConfigError: the file cannot be written.
        """
        self._rotate()
        try:
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise ConfigError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._start = os.fstat(descriptor).st_size
        return descriptor

    def last_line(self, prefix: str = "") -> str:
        """Return the last line that starts with `prefix` and that the current process wrote; '' if none."""
        self._rotate()
        return next((line for line in reversed(self._tail()) if line.startswith(prefix)), "")

    def _tail(self) -> list[str]:
        try:
            size = self.path.stat().st_size
            if self._seen == (self._start, size):
                return self._lines
            with self.path.open("rb") as file:
                file.seek(max(self._start, size - _TAIL_BYTES))
                text = file.read().decode(errors="replace")
        except OSError:
            return self._lines  # the folder is gone; what was read stays known
        self._seen = (self._start, size)
        self._lines = [line.strip() for line in text.splitlines() if line.strip()]
        return self._lines

    def _rotate(self) -> None:
        try:
            if self.path.stat().st_size <= self._limit_bytes:
                return
            self.path.with_suffix(".log.1").write_bytes(self.path.read_bytes())
            os.truncate(self.path, 0)
        except OSError:
            return
        self._start = 0
