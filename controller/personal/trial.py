"""The controller run with one setting or the other, while the rest of the system goes on.

`surefoot up --roles controller` as a process of its own: without it commands expire and the drive brakes, and the new
one begins in DISARMED, at rest, as any controller that is started. So the walker stands while a setting is changed.
"""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Final, Self

from bridge.errors import SurefootError

STOP_S: Final = 15.0


class Trial:
    """At most one controller at a time; it ends with the context."""

    def __init__(self, log: Path) -> None:
        self._log, self._running = log, log.with_name("running.toml")
        self._process: subprocess.Popen[bytes] | None = None
        self._builder: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        finally:
            self._end_builder()

    def prepare(self, configs: Sequence[Path]) -> None:
        """Have what the controller needs for `configs` built in the background."""
        self._end_builder()
        words = ["nice", sys.executable, "-m", "controller.personal.prepare", *map(str, configs)]
        self._builder = _started(words, subprocess.DEVNULL)

    def run(self, config: Path) -> None:
        """Stop the controller that runs, and start one with a copy of `config`, which may be rewritten meanwhile.

        Raises:
            SurefootError: the one before died; the text is the last line it said.
        """
        self.stop()
        shutil.copyfile(config, self._running)
        words = [
            sys.executable,
            "-m",
            "bridge.cli",
            "up",
            "--roles",
            "controller",
            "--no-screen",
            "--config",
            str(self._running),
        ]
        with self._log.open("wb") as log:
            self._process = _started(words, log)

    @property
    def over(self) -> bool:
        """Whether no controller runs."""
        return self._process is None or self._process.poll() is not None

    def stop(self) -> None:
        """Stop the controller, if one runs.

        Raises:
            SurefootError: it had died by itself.
        """
        process, self._process = self._process, None
        if process is None:
            return
        self._running.unlink(missing_ok=True)
        died = process.poll() not in (None, 0)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if died:
            said = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise SurefootError(f"the controller ended: {said[-1] if said else 'it said nothing'} ({self._log})")

    def _end_builder(self) -> None:
        builder, self._builder = self._builder, None
        if builder is not None:
            builder.kill()
            builder.wait()


def _started(words: list[str], output: IO[bytes] | int) -> subprocess.Popen[bytes]:
    return subprocess.Popen(  # noqa: S603 (ourselves)
        words, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
    )
