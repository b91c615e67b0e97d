"""Small nodes for every role, and a `surefoot up` to run them with: what the launcher's tests need."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from queue import Empty, Queue
from typing import Any

ROLES = ("perception", "anticipation", "controller", "drive")
PATIENCE_S = 60.0  # for a machine that is busy with other things

TOYS = '''
import os, signal, subprocess, sys
import numpy as np
from bridge.errors import SourceError
from bridge.inbox import Inbox
from bridge.messages import Keypoints, NodeStatus, SupportCommand
from bridge.node import main
from bridge.outbox import Outbox
from bridge.topics import KEYPOINTS, SUPPORT_COMMAND


class Toy:
    """Publishes what its role may publish; what else it does is said by its source."""

    period_s = 0.02

    def __init__(self, role, context):
        self.role, self.turns = role, 0
        name, _, self.value = context.options.get("source", "").partition(":")
        self.name = name
        if name == "missing":
            raise SourceError(f"{self.value}: no such source")
        if name == "litter":
            subprocess.Popen(["sleep", "1000"])
        self.keypoints = Outbox(context.transport, KEYPOINTS) if role == "perception" else None
        self.command = Outbox(context.transport, SUPPORT_COMMAND) if role == "controller" else None
        self.inbox = Inbox(context.transport, KEYPOINTS)

    def step(self, now_ns):
        self.turns += 1
        if self.name == "crash":
            print("toy fell over", file=sys.stderr)
            os._exit(3)
        if self.name == "deaf":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if self.keypoints:
            self.keypoints.send(Keypoints(stamp_ns=now_ns, position_px=np.ones((12, 2)), confidence=np.ones(12),
                status=np.zeros(12), body_length_px=50.0, image_width=320, image_height=240))
        if self.command:
            fault = self.inbox.read(now_ns).fault
            self.command.send(SupportCommand(stamp_ns=now_ns, velocity=np.zeros(4), acceleration=np.zeros(4),
                column_height=1.0, stiffening=0.25, damping=np.ones(4), stiffness=np.zeros(4),
                state="SAFE_STOP" if fault else "FOLLOW", solver="stop", lifetime_s=0.1, reason=fault))

    def wait(self):
        pass

    def status(self, now_ns):
        values = {"rate_hz": "50.0", "keypoints_age_ms": "12"}
        return NodeStatus(stamp_ns=now_ns, role=self.role, level=0, summary=f"{self.name or 'idle'}", values=values)

    def finished(self):
        return self.name == "turns" and self.turns >= int(self.value)

    def close(self):
        pass


def run(role):
    return main(role, lambda context: Toy(role, context))
'''


class Stage:
    """A folder with toy nodes, free ports and a configuration that uses both."""

    def __init__(self, folder: Path, launch: str = "") -> None:
        self.folder = folder
        self.mark = uuid.uuid4().hex  # every process started from here carries it in its environment
        self.ports = dict(zip(ROLES, free_ports(len(ROLES)), strict=True))
        (folder / "toys.py").write_text(TOYS)
        for role in ROLES:
            run = f"from toys import run\nif __name__ == '__main__':\n    raise SystemExit(run('{role}'))\n"
            (folder / f"toy_{role}.py").write_text(run)
        self.config = folder / "toys.toml"
        self.write_config(launch)

    def write_config(self, launch: str = "", modules: Mapping[str, str] | None = None) -> None:
        used = modules or {role: f"toy_{role}" for role in ROLES}
        self.config.write_text(
            f"version = 1\n[launch]\nlog_dir = '{self.folder / 'logs'}'\n{textwrap.dedent(launch)}\n"
            + "[launch.modules]\n"
            + "".join(f"{role} = '{module}'\n" for role, module in used.items())
            + "[bridge.endpoints]\n"
            + "".join(f"{role} = 'tcp/127.0.0.1:{port}'\n" for role, port in self.ports.items())
        )

    def environment(self) -> dict[str, str]:
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        return {**os.environ, "PYTHONPATH": path, "SUREFOOT_TEST": self.mark, "COLUMNS": "200"}

    def left(self) -> list[str]:
        """Return the command lines of the processes that were started from here and still run."""
        found = []
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit() or int(entry.name) == os.getpid():
                continue
            try:
                if self.mark.encode() in (entry / "environ").read_bytes():
                    found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode())
            except OSError:
                continue  # it ended while being looked at, or is another user's
        return found


class Up:
    """A running `surefoot up --json -`, read record by record."""

    def __init__(self, stage: Stage, *arguments: str) -> None:
        command = [sys.executable, "-m", "bridge.cli", "up", "--config", str(stage.config), "--json", "-", *arguments]
        self.process = subprocess.Popen(
            command,
            env=stage.environment(),
            cwd=stage.folder,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self._records: Queue[dict[str, Any]] = Queue()
        self.seen: list[dict[str, Any]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._records.put(json.loads(line))

    def wait_for(self, condition: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        """Return the first record from here on that satisfies `condition`."""
        deadline_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline_s:
            try:
                record = self._records.get(timeout=0.2)
            except Empty:
                if self.process.poll() is not None and not self._reader.is_alive() and self._records.empty():
                    break
                continue
            self.seen.append(record)
            if condition(record):
                return record
        code, errors = self.stop()
        raise AssertionError(f"never seen; exit code {code}, stderr {errors!r}, last {self.seen[-3:]}")

    def end(self) -> tuple[int, str]:
        """Wait for the end; return exit code and what stderr said."""
        code = self.process.wait(PATIENCE_S)
        self._reader.join(PATIENCE_S)
        while not self._records.empty():
            self.seen.append(self._records.get())
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        with self.process.stdout, self.process.stderr:
            return code, self.process.stderr.read()

    @property
    def events(self) -> list[str]:
        return [record["event"] for record in self.seen if "event" in record]

    def __enter__(self) -> Up:
        return self

    def stop(self) -> tuple[int, str]:
        """Make an end of it, if need be by force."""
        self.process.send_signal(signal.SIGTERM)
        try:
            return self.end()
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.end()

    def __exit__(self, *error: object) -> None:
        if self.process.poll() is None:
            self.stop()


def free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def wait_until(condition: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    deadline_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline_s, f"{what}: not within {patience_s:g} s"
        time.sleep(0.02)


def all_alive(roles: Sequence[str] = ROLES) -> Callable[[dict[str, Any]], bool]:
    def check(record: dict[str, Any]) -> bool:
        return all(record.get("roles", {}).get(role, {}).get("alive") for role in roles)

    return check


def listening(port: int) -> closing[socket.socket]:
    """Return a socket that occupies `port` until closed."""
    taker = socket.socket()
    taker.bind(("127.0.0.1", port))
    taker.listen()
    return closing(taker)
