"""The real processes on a wire of their own, with an observer that keeps every message on the way to a command."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Self

import numpy as np

from bridge.clock import SystemClock
from bridge.config.load import load_config
from bridge.errors import SurefootError
from bridge.latency.hops import Heard
from bridge.launch.clip import CLIP, shipped_recording
from bridge.launch.launcher import Launcher, ProcessState
from bridge.launch.monitor import Monitor, View
from bridge.launch.observer import Tap
from bridge.launch.private import private_wire
from bridge.messages import FallHorizon, Keypoints, SupportCommand
from bridge.topics import FALL_HORIZON, KEYPOINTS, SUPPORT_COMMAND
from bridge.transport.zenoh import ZenohTransport

ROLES: Final = ("perception", "anticipation", "controller", "drive")
POLL_S: Final = 0.005


def write_walk(path: Path, seconds: float) -> None:
    """Write `path` with the clip `walk`: the shipped recording's first five seconds, forward and backward again."""
    with np.load(shipped_recording()) as arrays:
        walk = arrays[f"{CLIP}/keypoints"][:150]
        fps, size = float(arrays[f"{CLIP}/fps"]), arrays[f"{CLIP}/image_size"]
    there_and_back = np.concatenate([walk, walk[-2:0:-1]])
    frames = np.arange(int(seconds * fps)) % len(there_and_back)
    np.savez(path, **{"walk/keypoints": there_and_back[frames], "walk/fps": fps, "walk/image_size": size})


class LiveSystem:
    """Perception, anticipation, controller and drive as `surefoot up` runs them, on free ports.

    Perception plays a generated walk, so no pose estimator is part of it.
    """

    def __init__(
        self, seconds: float, config: Path | None = None, overrides: Sequence[str] = (), controller: str | None = None
    ) -> None:
        """Prepare, but start nothing.

        Args:
            seconds: how much there is to walk [s].
            config: TOML file; None means the defaults.
            overrides: `section.key=value` on top of it.
            controller: mpc or log; None: what the configuration says.

        Raises:
            ConfigError: the configuration does not hold.
        """
        self._stack = ExitStack()
        folder = Path(self._stack.enter_context(TemporaryDirectory(prefix="surefoot-latency-")))
        write_walk(folder / "walk.npz", seconds)
        everything = [*overrides, *private_wire(config, overrides, ROLES, "latency"), f"launch.roles={list(ROLES)}"]
        loaded = load_config(config, everything)
        transport = ZenohTransport(loaded.bridge, "observer", SystemClock())
        self._stack.callback(transport.close)
        self._monitor = Monitor(transport, SystemClock())
        self._taps = {topic.key: Tap(transport, topic) for topic in (KEYPOINTS, FALL_HORIZON, SUPPORT_COMMAND)}
        self.keypoints: list[tuple[Keypoints, int]] = []  # each with its arrival [ns]
        self.horizons: list[tuple[FallHorizon, int]] = []
        self.commands: list[tuple[SupportCommand, int]] = []
        options = {"perception": {"source": f"{folder / 'walk.npz'}:walk"}}
        if controller is not None:
            options["controller"] = {"controller": controller}
        self.launcher = self._stack.enter_context(Launcher(loaded, config, everything, options))
        self.processes: Mapping[str, ProcessState] = {}
        self.view: View = self._monitor.look()

    def heard_since(self, since_ns: int) -> Heard:
        """Return what rests on frames and was computed after `since_ns`."""
        return Heard(
            [(m, t) for m, t in self.keypoints if m.stamp_ns >= since_ns],
            [(m, t) for m, t in self.horizons if m.stamp_ns >= since_ns],
            [(m, t) for m, t in self.commands if m.stamp_ns >= since_ns],
        )

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
            SurefootError: it does not within `limit_s`.
        """
        deadline_s = time.monotonic() + limit_s
        while not condition():
            self.look()
            if time.monotonic() > deadline_s:
                states = "; ".join(f"{p.role} {p.phase} {p.last_line}" for p in self.processes.values())
                raise SurefootError(f"{what}: not within {limit_s:g} s ({states})")
            time.sleep(POLL_S)

    def alive(self, *roles: str) -> bool:
        """Whether every one of `roles` is there, by its liveliness token."""
        return all(role in self.view.roles and self.view.roles[role].alive for role in roles)

    def start(self) -> None:
        """Start everything, perception last, and wait until a command moves on real horizons.

        Raises:
            SurefootError: none does.
        """
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
