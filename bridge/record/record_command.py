"""`surefoot record`: options, checks, and what is said."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from bridge.clock import SystemClock
from bridge.command_line.options import (
    ConfigOption,
    DurationOption,
    ForceOption,
    JsonOption,
    RecordingOut,
    SetOption,
    TopicsOption,
)
from bridge.command_line.output import note, require_writable, write_json
from bridge.config.load import load_config
from bridge.launch.watch import StopSignals
from bridge.record.layout import SUFFIX
from bridge.record.meter import Meter
from bridge.record.recorder import Recorder
from bridge.record.roles import parse_topics
from bridge.record.writer import BagWriter, RecordingError, require_free
from bridge.topics import TOPICS
from bridge.transport.zenoh import ZenohTransport

POLL_S: Final = 0.05
DEFAULT_FOLDER: Final = Path("runs")


def record(
    out: RecordingOut = None,
    force: ForceOption = False,
    topics: TopicsOption = None,
    duration: DurationOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Record what is on the wire, as it is, into an MCAP file in rosbag2 layout.

    Only listens: whatever happens to it, the running control notices nothing. Ends with Ctrl-C,
    SIGTERM or after --duration, and finishes the file; killed at any point, it leaves everything
    readable but the last second at most. Exit code 2: the file cannot be written (any more).

    Example: surefoot record --out walk.mcap --duration 60
    """
    loaded = load_config(config, set_ or [])
    if json is not None:
        require_writable(json)
    wanted = parse_topics(topics) if topics is not None else TOPICS
    path = out or _default_name()
    require_free(path, overwrite=force)
    # signals are ours from when there is something to finish
    with closing(ZenohTransport(loaded.bridge, "recorder", SystemClock())) as wire, StopSignals() as stop:
        recorder = Recorder(wire, wanted, BagWriter(path, loaded.bridge.namespace, wanted, overwrite=force))
        note(f"recording {len(wanted)} topics to {path}; Ctrl-C ends it")
        started_s = time.monotonic()
        meter = Meter()
        while stop.seen is None and recorder.failure is None:
            elapsed_s = time.monotonic() - started_s
            if duration is not None and elapsed_s >= duration:
                break
            if meter.due():
                meter.show(_state(recorder, elapsed_s))
            time.sleep(POLL_S)
        meter.end()
        recorder.close()
    elapsed_s = time.monotonic() - started_s
    note(f"{path}: {_state(recorder, elapsed_s)}")
    if json is not None:
        write_json(json, _plain(recorder, path, elapsed_s))
    return 0


def _default_name() -> Path:
    try:
        DEFAULT_FOLDER.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{DEFAULT_FOLDER}: cannot be created: {error.strerror}") from error
    return DEFAULT_FOLDER / f"recording-{time.strftime('%Y%m%d-%H%M%S')}{SUFFIX}"


def _plain(recorder: Recorder, path: Path, elapsed_s: float) -> dict[str, Any]:
    writer = recorder.writer
    return {
        "path": path,
        "seconds": round(elapsed_s, 3),
        "messages": writer.messages,
        "bytes": writer.bytes_written,
        "not_recorded": dict(recorder.dropped),
    }


def _state(recorder: Recorder, elapsed_s: float) -> str:
    """Return how much was recorded, and what of it is missing."""
    writer = recorder.writer
    text = f"{writer.messages} messages in {elapsed_s:.1f} s, {writer.bytes_written / 1e6:.2f} MB"
    dropped = recorder.dropped
    if dropped:
        lost = ", ".join(f"{count} {key}" for key, count in sorted(dropped.items()))
        text += f"; the disk did not keep up, not recorded: {lost}"
    return text
