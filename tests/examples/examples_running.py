"""`surefoot up` as a user starts it, on free ports, and a door to its wire."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from bridge.clock import SystemClock
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.launch.ports import free_ports
from bridge.messages import NodeStatus
from bridge.topics import DIAGNOSTICS
from bridge.transport.zenoh import ZenohTransport

REPO = Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0  # for a machine that is busy with other things
ROLES = ("perception", "anticipation", "controller", "drive")


class Running:
    """The processes of `roles`, run by `surefoot up`; the test speaks on the wire as `speaker`."""

    def __init__(self, folder: Path, roles: str, speaker: str, *arguments: str) -> None:
        ports = free_ports(len(ROLES))
        endpoints = [f"bridge.endpoints.{role}=tcp/127.0.0.1:{port}" for role, port in zip(ROLES, ports, strict=True)]
        options = [*endpoints, f'launch.log_dir="{folder / "logs"}"']
        command = [sys.executable, "-m", "bridge.cli", "up", "--roles", roles, *arguments]
        self.logs, self._said = folder / "logs", (folder / "up.txt").open("w+")
        self.process = subprocess.Popen(
            [*command, *(word for option in options for word in ("--set", option))],
            cwd=REPO,
            stdout=self._said,
            stderr=subprocess.STDOUT,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
        self.clock = SystemClock()
        self.wire = ZenohTransport(load_config(None, endpoints).bridge, speaker, self.clock)
        self.statuses: Inbox[NodeStatus] = Inbox(self.wire, DIAGNOSTICS, depth=64)

    def until(self, condition: Callable[[int], object], what: str) -> None:
        """Call `condition(now_ns)` a hundred times a second until it holds."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition(self.clock.now_ns()):
            if self.process.poll() is not None or time.monotonic() > end_s:
                raise AssertionError(f"{what}: not seen; exit code {self.process.poll()}\n{self.said()}")
            time.sleep(0.01)

    def summary(self, role: str) -> str:
        """Return what `role` last said of itself."""
        newest = [status for status in self.statuses.drain(self.clock.now_ns()) if status.role == role]
        return newest[-1].summary if newest else ""

    def said(self) -> str:
        """Return what `surefoot up` and its processes wrote."""
        self._said.flush()
        logs = [path.read_text() for path in sorted(self.logs.glob("*.log"))] if self.logs.is_dir() else []
        return "\n".join([Path(self._said.name).read_text(), *logs])

    def stop(self) -> int:
        """Press Ctrl-C and return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE_S)

    def __enter__(self) -> Running:
        return self

    def __exit__(self, *error: object) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(PATIENCE_S)
        self.wire.close()
        self._said.close()
