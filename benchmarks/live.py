"""The real processes on a wire of their own, with an observer that keeps every command and horizon."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import numpy as np

from bridge.clock import SystemClock
from bridge.config.load import load_config
from bridge.launch.launcher import Launcher, ProcessState
from bridge.launch.monitor import Monitor, View
from bridge.launch.observer import Tap
from bridge.messages import FallHorizon, Keypoints, SupportCommand
from bridge.topics import FALL_HORIZON, KEYPOINTS, SUPPORT_COMMAND
from bridge.transport.zenoh import ZenohTransport

ROLES = ("perception", "anticipation", "controller", "drive")
CLIP = "walk-stumble-fall"


def write_walk(path: Path, seconds: float) -> None:
    """Write `path` with the clip `walk`: the shipped recording's first five seconds, forward and backward again."""
    recording = Path(str(resources.files("simulation"))) / "demo" / f"{CLIP}.npz"
    with np.load(recording) as arrays:
        walk = arrays[f"{CLIP}/keypoints"][:150]
        fps, size = float(arrays[f"{CLIP}/fps"]), arrays[f"{CLIP}/image_size"]
    there_and_back = np.concatenate([walk, walk[-2:0:-1]])
    frames = np.arange(int(seconds * fps)) % len(there_and_back)
    np.savez(path, **{"walk/keypoints": there_and_back[frames], "walk/fps": fps, "walk/image_size": size})


class Live:
    """Perception, anticipation, controller and drive as `surefoot up` runs them, on free ports."""

    def __init__(self, seconds: float, controller: str, overrides: Sequence[str] = ()) -> None:
        self._stack = ExitStack()
        folder = Path(self._stack.enter_context(TemporaryDirectory(prefix="surefoot-bench-")))
        write_walk(folder / "walk.npz", seconds)
        own = [
            f"bridge.endpoints.{role}=tcp/127.0.0.1:{port}"
            for role, port in zip(ROLES, free_ports(len(ROLES)), strict=True)
        ]
        everything = [f"bridge.namespace=bench-{os.getpid()}", *own, *overrides]
        config = load_config(None, everything)
        transport = ZenohTransport(config.bridge, "bench", SystemClock())
        self._stack.callback(transport.close)
        self._monitor = Monitor(transport, SystemClock())
        self._taps = {topic.key: Tap(transport, topic) for topic in (KEYPOINTS, FALL_HORIZON, SUPPORT_COMMAND)}
        self.keypoints: list[tuple[Keypoints, int]] = []  # each with its arrival [ns]
        self.horizons: list[tuple[FallHorizon, int]] = []
        self.commands: list[tuple[SupportCommand, int]] = []
        options = {"perception": {"source": f"{folder / 'walk.npz'}:walk"}, "controller": {"controller": controller}}
        self.launcher = self._stack.enter_context(Launcher(config, None, everything, options))
        self.processes: Mapping[str, ProcessState] = {}
        self.view: View = self._monitor.look()

    def look(self) -> None:
        """Take in what arrived and how the processes are."""
        lists: dict[str, list[Any]] = {
            KEYPOINTS.key: self.keypoints,
            FALL_HORIZON.key: self.horizons,
            SUPPORT_COMMAND.key: self.commands,
        }
        for key, tap in self._taps.items():
            lists[key].extend(tap.drain())
        self.processes, self.view = self.launcher.poll(), self._monitor.look()

    def until(self, condition: Callable[[], object], what: str, limit_s: float = 90.0) -> None:
        """Look until `condition` holds.

        Raises:
            SystemExit: it does not within `limit_s`, or a process ended that should run.
        """
        deadline_s = time.monotonic() + limit_s
        while not condition():
            self.look()
            if time.monotonic() > deadline_s:
                states = "; ".join(f"{p.role} {p.phase} {p.last_line}" for p in self.processes.values())
                raise SystemExit(f"{what}: not within {limit_s:g} s ({states})")
            time.sleep(0.005)

    def alive(self, *roles: str) -> bool:
        """Whether every one of `roles` is there, by its liveliness token."""
        return all(role in self.view.roles and self.view.roles[role].alive for role in roles)

    def start(self) -> None:
        """Start everything, perception last, and wait until a command moves on real horizons."""
        self.launcher.start(role for role in ROLES if role != "perception")
        self.until(lambda: self.alive(*ROLES[1:]), "start of the processes")
        self.launcher.start(["perception"])
        self.until(self.following, "first command that follows")

    def following(self) -> bool:
        """Whether the newest command is none of a stop and rests on a frame."""
        command = self.view.command.message
        return command is not None and command.solver != "stop" and command.rests_on_ns > 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()


def percentiles(values_ms: Sequence[float]) -> dict[str, float]:
    """Return count, median, 99th percentile and maximum."""
    p50, p99 = np.percentile(values_ms, [50, 99])
    return {
        "count": len(values_ms),
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "max_ms": round(max(values_ms), 3),
    }


def machine() -> dict[str, Any]:
    """Return what numbers of time depend on."""
    return {"cores": os.cpu_count(), "load_1min": round(os.getloadavg()[0], 2)}


def report(result: Mapping[str, Any], file: Path | None) -> None:
    """Print `result`, and write it to `file` where one is named."""
    text = json.dumps(result, indent=2)
    print(text)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + "\n")


def free_ports(count: int) -> list[int]:
    """Return ports of this machine that nobody listens on."""
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports
