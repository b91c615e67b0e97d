"""Watching the configuration file while the system runs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError


class Watcher:
    """Reads the file again, in a thread of its own, whenever it changes.

    `poll` only looks into a queue, so a control loop can call it every step. The
    file's content decides, not its time stamp: editors replace files in many ways.
    """

    def __init__(self, path: Path | None, overrides: Sequence[str] = (), period_s: float = 0.25) -> None:
        self._path, self._overrides, self._period_s = path, tuple(overrides), period_s
        self._news: deque[SurefootConfig | str] = deque(maxlen=8)
        self._stop = threading.Event()
        self._content = self._peek()
        self._thread: threading.Thread | None = None
        if path is not None:
            self._thread = threading.Thread(target=self._watch, name="config-watcher", daemon=True)
            self._thread.start()

    def poll(self) -> SurefootConfig | str | None:
        """Return the new configuration, the reason why the changed file was refused, or None if nothing changed."""
        return self._news.popleft() if self._news else None

    def close(self) -> None:
        """Stop watching."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)

    def check(self) -> None:
        """Look at the file once, now."""
        content = self._peek()
        if content == self._content or self._path is None:
            return
        self._content = content
        try:
            self._news.append(load_config(self._path, self._overrides))
        except ConfigError as error:
            self._news.append(str(error))

    def _watch(self) -> None:
        while not self._stop.wait(self._period_s):
            self.check()

    def _peek(self) -> bytes | None:
        try:
            return None if self._path is None else self._path.read_bytes()
        except OSError:
            return None
