"""The processes run once, watched from the wire until they have done their part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from bridge.clock import SystemClock
from bridge.config.load import load_config
from bridge.errors import SurefootError
from bridge.launch.launcher import Launcher, Phase, ProcessState
from bridge.launch.monitor import View
from bridge.launch.observer import Enough, Observer
from bridge.launch.timeline import Recorder
from bridge.launch.watch import Limits, watch_over
from bridge.transport.interface import Transport
from bridge.transport.zenoh import ZenohTransport


class _UntilFinished(Observer):
    """Watches until a role's process has come to its end, for those whose end does not end a run by itself."""

    def __init__(
        self, console: Console, recorder: Recorder, transport: Transport, seconds: float | None, role: str
    ) -> None:
        super().__init__(console, recorder, transport, seconds)
        self._role = role

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Print what is due."""
        super().show(elapsed_s, processes, view)
        if self._role and processes[self._role].phase is Phase.FINISHED:
            raise Enough


def observe(
    config: Path | None,
    overrides: Sequence[str],
    options: Mapping[str, Mapping[str, str]],
    log_dir: Path,
    console: Console,
    *,
    limit_s: float,
    until: str = "",
    seconds: float | None = None,
) -> Recorder:
    """Run `launch.roles`, print what happens, return what was on the wire.

    Ends with perception's source, with the process of role `until`, after `seconds` of keypoints, or after `limit_s`.

    Raises:
        SurefootError: a process died.
    """
    loaded = load_config(config, overrides)
    recorder = Recorder()
    transport = ZenohTransport(loaded.bridge, "observer", SystemClock())
    try:
        observer = _UntilFinished(console, recorder, transport, seconds, until)
        with Launcher(loaded, config, overrides, options, log_dir) as launcher:
            try:
                given_up = watch_over(launcher, loaded, observer, Limits(duration_s=limit_s))
            except Enough:
                return recorder
            for process in given_up:
                raise SurefootError(f"{process.role} died with exit code {process.exit_code}: {process.last_line}")
    finally:
        transport.close()
    return recorder
