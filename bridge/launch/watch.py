"""The life of `surefoot up`: from the first process to the last."""

from __future__ import annotations

import signal
import time
from collections.abc import Mapping
from types import FrameType
from typing import Final, NamedTuple, Self

from bridge.clock import SystemClock
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from bridge.launch.display import Display
from bridge.launch.launcher import SOURCE, Launcher, Phase, ProcessState
from bridge.launch.monitor import Monitor, View
from bridge.messages import GaitState
from bridge.transport.zenoh import ZenohTransport

POLL_S: Final = 0.05
SETTLE_LIMIT_S: Final = 2.0  # the safe command is due 0.2 s after the last horizon
AT_REST: Final = (GaitState.SAFE_STOP, GaitState.DISARMED)


class Limits(NamedTuple):
    """When `surefoot up` ends by itself."""

    duration_s: float | None = None  # after this long
    keep_running: bool = False  # not when the source is at its end


class StopSignals:
    """SIGINT, SIGTERM and SIGHUP set a flag while the context is open; what was installed before comes back after."""

    NUMBERS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self) -> None:
        self.seen: signal.Signals | None = None

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._note) for number in self.NUMBERS}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.seen = signal.Signals(number)


def watch_over(launcher: Launcher, config: SurefootConfig, display: Display, limits: Limits) -> list[ProcessState]:
    """Start the processes of `launcher`, watch over them until it is time to end, and stop them.

    Returns:
        The roles that died and were given up.

    Raises:
        SurefootError: a process refused its input; the text is what it said.
    """
    clock = SystemClock()
    with StopSignals() as stop, display:
        transport = ZenohTransport(config.bridge, "monitor", clock)
        try:
            watch = Watch(launcher, Monitor(transport, clock), limits)
            while not (reason := watch.turn(stop.seen)):
                display.show(watch.elapsed_s, watch.processes, watch.view)
                if watch.news:
                    display.say(watch.elapsed_s, watch.news)
                time.sleep(POLL_S)
            display.say(watch.elapsed_s, reason)
            display.show(watch.elapsed_s, watch.processes, watch.view)
        finally:
            launcher.stop()
            transport.close()
    return [process for process in watch.processes.values() if process.phase is Phase.FAILED]


class Watch:
    """What `watch_over` knows from one turn to the next: how everything is, and when it is time to end."""

    def __init__(self, launcher: Launcher, monitor: Monitor, limits: Limits) -> None:
        self._launcher, self._monitor, self._limits = launcher, monitor, limits
        self._started_s = time.monotonic()
        self._source_ended_s: float | None = None
        self.news = ""
        self.processes: Mapping[str, ProcessState] = {}
        self.view: View = monitor.look()
        launcher.start()

    @property
    def elapsed_s(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._started_s

    def turn(self, stop: signal.Signals | None) -> str:
        """Look after everything once; return why it is time to end, or ''."""
        self.news = ""
        self.processes, self.view = self._launcher.poll(), self._monitor.look()
        for process in self.processes.values():
            if process.phase is Phase.REFUSED:
                raise SurefootError(process.last_line.removeprefix("surefoot ") or f"{process.role} refused its input")
        if stop is not None:
            return f"stopped by {stop.name}"
        if self._limits.duration_s is not None and self.elapsed_s >= self._limits.duration_s:
            return f"stopped after {self._limits.duration_s:g} s, as asked"
        source = self.processes.get(SOURCE)
        if not any(process.alive for process in self.processes.values()):
            return "no process is left running"
        if source is not None and source.phase is Phase.FINISHED and not self._limits.keep_running:
            return self._after_source()
        return ""

    def _after_source(self) -> str:
        """Let the controller be seen going safe before everything ends."""
        if self._source_ended_s is None:
            self._source_ended_s = self.elapsed_s
            self.news = f"{SOURCE} has finished: its source is at the end"
            return ""
        waited_s = self.elapsed_s - self._source_ended_s
        controller = self.view.roles.get("controller")
        command = self.view.command.message
        if command is not None and command.state in AT_REST:
            return f"ended: the source is at its end, the controller commands {command.state}"
        if controller is None or not controller.alive:
            return "ended: the source is at its end"
        if waited_s > SETTLE_LIMIT_S:
            return f"ended: the source is at its end; the controller did not stop within {SETTLE_LIMIT_S:g} s"
        return ""
