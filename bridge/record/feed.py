"""Feeding a recording to real processes in real time: the replayed roles run, the others are stood in for."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Final, NamedTuple

from bridge.clock import SystemClock
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from bridge.launch.launcher import Launcher, Phase
from bridge.record.online import LOOK_S, Pace, Played, StandIns, confined, play
from bridge.record.reader import Recording
from bridge.record.recorder import Recorder
from bridge.record.roles import inputs, outputs
from bridge.record.writer import BagWriter
from bridge.transport.zenoh import ZenohTransport

SETTLE_S: Final = 0.5  # after the last message, for its answer


class Processes(NamedTuple):
    """What runs, and with what: see `Launcher`."""

    roles: Sequence[str]
    config: SurefootConfig
    config_path: Path | None
    overrides: Sequence[str]
    options: Mapping[str, Mapping[str, str]]


def feed(
    recording: Recording,
    processes: Processes,
    pace: Pace,
    writer: BagWriter | None,
    watch: Callable[[float], bool],
) -> Played:
    """Start the processes, publish their recorded inputs, and write what they answer.

    Args:
        recording: what to feed.
        processes: what to feed it to.
        pace: how fast; the delay runs from the moment the processes are there.
        writer: where their answers go; None: nowhere.
        watch: see `play`; asked while waiting for the processes too.

    Raises:
        SurefootError: a process refused its input, died, or did not come up; the recording or the disk failed.
    """
    config = processes.config
    topics = inputs(processes.roles)
    clock = SystemClock()
    with ExitStack() as stack:
        stand_ins = stack.enter_context(StandIns(config.bridge, {topic.publisher for topic in topics}, clock))
        wire = stack.enter_context(closing(ZenohTransport(confined(config.bridge), "recorder", clock)))
        if writer is not None:
            stack.enter_context(closing(Recorder(wire, outputs(processes.roles), writer)))
        launcher = stack.enter_context(_launcher(processes))
        launcher.start()

        def look(progress: float) -> bool:
            _require_running(launcher)
            return watch(progress)

        deadline_s = time.monotonic() + config.launch.ready_timeout_s
        while not stand_ins.all_see(processes.roles):
            if look(0.0):
                return Played({}, 0.0)
            if time.monotonic() > deadline_s:
                raise SurefootError(
                    f"{' and '.join(processes.roles)} not there after {config.launch.ready_timeout_s:g} s "
                    "(launch.ready_timeout_s)"
                )
            time.sleep(LOOK_S)
        played = play(recording, topics, stand_ins, pace, clock, look)
        time.sleep(SETTLE_S)
    return played


def _launcher(processes: Processes) -> Launcher:
    launch = processes.config.launch.model_copy(update={"roles": tuple(processes.roles)})
    config = processes.config.model_copy(update={"launch": launch})
    overrides = [
        *processes.overrides,
        "bridge.connect=[]",
        "bridge.mode=peer",
    ]  # what is fed stays here, see `confined`
    return Launcher(config, processes.config_path, overrides, processes.options)


def _require_running(launcher: Launcher) -> None:
    for role, process in launcher.poll().items():
        if process.phase is Phase.REFUSED:
            raise SurefootError(process.last_line.removeprefix("surefoot ") or f"{role} refused its input")
        if process.phase in (Phase.FAILED, Phase.FINISHED):
            raise SurefootError(f"{role} ended (exit code {process.exit_code}): {process.last_line}")
