"""Rerun's viewer as a process: a window or a web page.

It listens on loopback only, its usage statistics are off, and it runs in a process group of its
own: Ctrl-C reaches `surefoot view` alone, which then ends the whole group.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, Self

from bridge.errors import SurefootError
from bridge.launch.ports import free_ports

LOOPBACK: Final = "127.0.0.1"
READY_S: Final = 30.0
STOP_S: Final = 3.0
MEMORY: Final = "2GiB"  # of what is shown; the oldest is dropped beyond it
INSTEAD: Final = "--out FILE.rrd writes a file instead, --serve shows it in a browser"


class Viewer:
    """The process; stopped with everything it started when the context is left.

    Raises:
        SurefootError: there is no display, a port is taken, or it does not start.
    """

    def __init__(self, program: Path, port: int, arguments: Sequence[str]) -> None:
        self.url = f"rerun+http://{LOOPBACK}:{port}/proxy"
        self._folder = tempfile.TemporaryDirectory(prefix="surefoot-view-")
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (closed by close)
        common = ["--bind", LOOPBACK, "--port", str(port), "--memory-limit", MEMORY, "--server-memory-limit", MEMORY]
        self._process = subprocess.Popen(  # noqa: S603 (the program of the installed package)
            [str(program), *common, *arguments],
            env=self._environment(),
            stdin=subprocess.DEVNULL,
            stdout=self._said,
            stderr=self._said,
            start_new_session=True,
        )
        try:
            self._await(port)
        except BaseException:
            self.close()
            raise

    @property
    def running(self) -> bool:
        """Whether it is still there."""
        return self._process.poll() is None

    def require_well(self) -> None:
        """Raise if it has died; that its window was closed is no fault.

        Raises:
            SurefootError: it has; the text is what it said.
        """
        if self._process.poll():
            raise SurefootError(f"Rerun's viewer died: {self._last_words()}; {INSTEAD}")

    def close(self) -> None:
        """End it."""
        for number, patience_s in ((signal.SIGTERM, STOP_S), (signal.SIGKILL, STOP_S)):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, number)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(patience_s)
                break
        self._said.close()
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _environment(self) -> dict[str, str]:
        """Return an environment with a configuration folder in which Rerun's statistics are off."""
        folder = Path(self._folder.name) / "rerun"
        folder.mkdir()
        settings = {
            "analytics_enabled": False,
            "analytics_id": "",
            "metadata": {},
            "config_file_path": str(folder / "analytics.json"),
            "data_dir_path": str(folder),
        }
        (folder / "analytics.json").write_text(json.dumps(settings))
        quiet = {"RUST_LOG": os.environ.get("RUST_LOG", "warn"), "NO_COLOR": "1"}
        return {**os.environ, **quiet, "XDG_CONFIG_HOME": self._folder.name}

    def _await(self, port: int) -> None:
        deadline_s = time.monotonic() + READY_S
        while time.monotonic() < deadline_s:
            if not self.running:
                raise SurefootError(f"Rerun's viewer ended at once: {self._last_words()}; {INSTEAD}")
            with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=0.2):
                return
            time.sleep(0.02)
        raise SurefootError(f"Rerun's viewer did not begin to listen within {READY_S:g} s; {INSTEAD}")

    def _last_words(self) -> str:
        self._said.seek(0)
        lines = [line.strip() for line in self._said.read().decode(errors="replace").splitlines() if line.strip()]
        telling = [line for line in lines if "rror" in line or "panicked" in line] or lines
        return telling[0][:300] if telling else f"exit code {self._process.returncode}"


def window(program: Path) -> Viewer:
    """Open a window.

    Raises:
        SurefootError: there is no display, or the window does not come up.
    """
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SurefootError(f"there is no display to open a window on; {INSTEAD}")
    return Viewer(program, free_ports(1)[0], ["--hide-welcome-screen", "--expect-data-soon"])


def web(program: Path, port: int) -> Viewer:
    """Serve the viewer as a web page at `port`, its data at `port` + 1.

    Raises:
        SurefootError: one of the ports is taken.
    """
    for number in (port, port + 1):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((LOOPBACK, number))
            except (OSError, OverflowError) as error:
                raise SurefootError(f"port {number} cannot be listened on ({error}); --port names another") from error
    return Viewer(program, port + 1, ["--serve-web", "--web-viewer-port", str(port)])


def page(port: int) -> str:
    """Return the address for a browser."""
    return f"http://{LOOPBACK}:{port}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{port + 1}%2Fproxy"
