"""The processes of one machine: started, watched, started again, stopped, none left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SurefootError
from bridge.keys.identity import OBSERVER, identity_of
from bridge.launch.logfile import LogFile

BAD_INPUT = SurefootError.exit_code
SOURCE = "perception"


class Phase(StrEnum):
    """Where a process is in its life."""

    WAITING = "waiting"  # not started yet
    RUNNING = "running"
    FINISHED = "finished"  # exit code 0: nothing left to do
    REFUSED = "refused"  # exit code 2: bad input, said in one line
    FAILED = "failed"  # died, and is not started again
    STOPPED = "stopped"  # by `stop`


class ProcessState(NamedTuple):
    """One role's process at one moment."""

    role: str
    pid: int
    alive: bool
    restarts: int
    exit_code: int | None  # of the last process that ended; negative: killed by that signal
    last_line: str  # last line it wrote to stderr; where it refused, its one-line error
    phase: Phase


class Launcher:
    """Runs the roles of `launch.roles` as processes, each in a session of its own.

    As a context manager it leaves nothing behind; it starts nothing by itself.
    Call `start` and `poll` from one thread that lives as long as the processes
    should: the kernel kills a child when the thread that started it ends.
    """

    def __init__(
        self,
        config: SurefootConfig,
        config_path: Path | None = None,
        overrides: Sequence[str] = (),
        options: Mapping[str, Mapping[str, str]] | None = None,
        log_dir: Path | None = None,
    ) -> None:
        """Prepare, but start nothing.

        Args:
            config: as loaded from `config_path` and `overrides`, which the processes load again.
            config_path: TOML file; None means the defaults.
            overrides: `section.key=value` on top of the file.
            options: options of each role, by name; they win over the config.
            log_dir: folder for `ROLE.log`; None keeps the logs in a temporary folder.

        Raises:
            ConfigError: `log_dir` cannot be made or written.
        """
        self._launch = config.launch
        self._temporary = tempfile.TemporaryDirectory(prefix="surefoot-") if log_dir is None else None
        folder = log_dir or Path(self._temporary.name if self._temporary else ".")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"{folder}: cannot be made for the logs: {error.strerror}") from error
        common = [*(["--config", str(config_path)] if config_path else [])]
        common += [word for override in overrides for word in ("--set", override)]
        given = options or {}
        self._children = {
            role: _Child(
                role,
                [
                    self._launch.modules[role],
                    *common,
                    *_option_words(given.get(role, {})),
                    *_after_words(role, self._launch.roles, sealed=bool(config.bridge.keys)),
                ],
                LogFile(folder, role),
            )
            for role in self._launch.roles
        }

    def start(self, roles: Iterable[str] | None = None) -> None:
        """Start those of `roles` (None: all) that are not running."""
        for role in self._children if roles is None else roles:
            if self._children[role].phase is not Phase.RUNNING:
                self._children[role].start()

    def poll(self) -> dict[str, ProcessState]:
        """Start again what died, within the limit, and return how every role is."""
        now_s = time.monotonic()
        for child in self._children.values():
            if child.ended() and child.phase is Phase.FAILED and self._may_restart(child, now_s):
                child.restarts.append(now_s)
                child.total_restarts += 1
                child.start()
        return {role: child.state() for role, child in self._children.items()}

    def stop(self) -> None:
        """Ask every process to stop, kill after `stop_timeout_s` what has not; may be called again."""
        deadline_s = time.monotonic() + self._launch.stop_timeout_s
        for child in self._children.values():
            child.signal(signal.SIGTERM)
        while any(child.running() for child in self._children.values()) and time.monotonic() < deadline_s:
            time.sleep(0.01)
        for child in self._children.values():
            child.kill()

    def close(self) -> None:
        """Stop, and remove logs that nobody asked to keep."""
        self.stop()
        if self._temporary is not None:
            self._temporary.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _may_restart(self, child: _Child, now_s: float) -> bool:
        if not self._launch.restart:
            return False
        while child.restarts and now_s - child.restarts[0] > self._launch.restart_window_s:
            child.restarts.popleft()
        return len(child.restarts) < self._launch.restart_limit


class _Child:
    """The process of one role and those that went before it."""

    def __init__(self, role: str, arguments: Sequence[str], log: LogFile) -> None:
        self.role, self._arguments, self._log = role, tuple(arguments), log
        self._process: subprocess.Popen[bytes] | None = None
        self._exit_code: int | None = None
        self.phase = Phase.WAITING
        self.restarts: deque[float] = deque()  # recent, monotonic [s]
        self.total_restarts = 0

    def start(self) -> None:
        command = [sys.executable, "-P", "-m", "bridge.launch.child", str(os.getpid()), *self._arguments]
        descriptor = self._log.open()
        try:
            self._process = subprocess.Popen(  # noqa: S603 (modules come from the configuration)
                command, stdin=subprocess.DEVNULL, stdout=descriptor, stderr=descriptor, start_new_session=True
            )
        finally:
            os.close(descriptor)
        self.phase = Phase.RUNNING

    def running(self) -> bool:
        """Whether the process runs; one that has ended is not reaped, so that its group keeps its number."""
        if self.phase is not Phase.RUNNING or self._process is None:
            return False
        return os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None

    def ended(self) -> bool:
        """Whether the process has ended since last asked; takes note of how."""
        if self.phase is not Phase.RUNNING or self.running():
            return False
        self._reap()
        self.phase = {0: Phase.FINISHED, BAD_INPUT: Phase.REFUSED}.get(self._exit_code or 0, Phase.FAILED)
        return True

    def signal(self, number: signal.Signals) -> None:
        """Send `number` to the process and all it started."""
        if self.phase is Phase.RUNNING and self._process is not None:
            os.killpg(self._process.pid, number)

    def kill(self) -> None:
        """Leave nothing of the process and its group."""
        if self.phase is Phase.RUNNING:
            self._reap()
            self.phase = Phase.STOPPED

    def _reap(self) -> None:
        self.signal(signal.SIGKILL)  # also what the process itself started and left
        if self._process is not None:
            self._exit_code = self._process.wait()

    def state(self) -> ProcessState:
        alive = self.phase is Phase.RUNNING
        prefix = f"surefoot {self.role}: " if self.phase is Phase.REFUSED else ""
        line = self._log.last_line(prefix) or self._log.last_line()
        pid = self._process.pid if self._process is not None else 0
        return ProcessState(self.role, pid, alive, self.total_restarts, self._exit_code, line, self.phase)


def _after_words(role: str, roles: Iterable[str], *, sealed: bool) -> list[str]:
    """What the source publishes is lost on those that do not listen yet, so it waits for them.

    Where certificates are asked for, one who may only observe cannot say that it is up.
    """
    if role != SOURCE:
        return []
    awaited = (other for other in roles if other != SOURCE and not (sealed and identity_of(other) == OBSERVER))
    return [word for other in awaited for word in ("--after", other)]


def _option_words(options: Mapping[str, str]) -> list[str]:
    return [word for name, value in options.items() for word in ("--option", f"{name}={value}")]
