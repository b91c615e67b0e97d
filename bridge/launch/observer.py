"""Watching a run of the demo: every message kept, and a line for every moment that is worth one."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, Final, Self

from rich.console import Console
from rich.text import Text

from bridge.codec import decode
from bridge.errors import InvalidMessage, SurefootError
from bridge.launch.launcher import Phase, ProcessState
from bridge.launch.monitor import View
from bridge.launch.timeline import Recorder, Row, Ticker
from bridge.messages import Message
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from bridge.transport.interface import Sample, Transport

STYLES: Final = {
    "FOLLOW": "blue",
    "GUARD": "yellow",
    "ARREST": "bold red",
    "RECOVER": "green",
    "SAFE_STOP": "dim",
    "DISARMED": "dim",
}
HEADER: Final = (
    "  time  state      stiffening  p(fall)  distance to boundary  damping x  stiffness x   base\n"
    "   [s]                 [0..1]  500 ms   now -> 500 ms [sd]     [N s/m]        [N/m]  [m/s]"
)


class Enough(Exception):  # noqa: N818 (not an error: the time asked for is over)
    """As much of the recording was shown as was asked for."""


class Observer:
    """A `Display` of `watch_over` that listens to the wire itself and prints what happens."""

    def __init__(self, console: Console, recorder: Recorder, transport: Transport, seconds: float | None) -> None:
        self._console, self._recorder, self._seconds = console, recorder, seconds
        self._ticker = Ticker(recorder)
        topics = (KEYPOINTS, FALL_HORIZON, ODOMETRY, WRENCH, SUPPORT_COMMAND)
        self._taps = [Tap(transport, topic) for topic in topics]
        self._headed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def show(self, elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> None:
        """Take in what came over the wire and print the lines that are due."""
        del elapsed_s, view
        for process in processes.values():
            if process.phase is Phase.FAILED:
                raise SurefootError(f"{process.role} died with exit code {process.exit_code}: {process.last_line}")
        for tap in self._taps:
            for message, arrival_ns in tap.drain():
                self._recorder.add(message, arrival_ns)
        for row, changed in self._ticker.new():
            if not self._headed:
                self._console.print(Text(HEADER, style="bold"))
                self._headed = True
            if changed:
                self._console.print(Text(f"{row.time_s:6.2f}  {row.state}: {row.reason}", STYLES.get(row.state, "")))
            self._console.print(line(row))
            if self._seconds is not None and row.time_s >= self._seconds:
                raise Enough

    def say(self, elapsed_s: float, text: str) -> None:
        """Print what happened to the processes."""
        self._console.print(Text(f"{elapsed_s:.1f} s after the start: {text}", "dim"))


class Tap:
    """Every message of one topic, with when it arrived; what does not decode is dropped."""

    def __init__(self, transport: Transport, topic: Topic) -> None:
        self._topic = topic
        self._samples: deque[Sample] = deque()
        self._handle = transport.subscribe(topic, self._samples.append)

    def drain(self) -> Iterator[tuple[Message, int]]:
        """Give the messages since the last call, each with its arrival [ns]."""
        while self._samples:
            sample = self._samples.popleft()
            try:
                message: Any = decode(self._topic, sample.payload, max(sample.sequence, 0))
            except InvalidMessage:
                continue
            yield message, sample.arrival_ns


def line(row: Row) -> Text:
    """Return the printed line of one moment; '-' where a number is not known."""
    text = Text(f"{row.time_s:6.2f}  ")
    text.append(f"{row.state or '-':<10} ", style=STYLES.get(row.state, ""))
    text.append(f"{_bar(row.stiffening)} {_number(row.stiffening, '4.2f')} ")
    text.append(f" {_number(row.fall_ahead, '6.2f')}   ")
    text.append(f"{_number(row.distance, '8.2f')} -> {_number(row.distance_ahead, '6.2f')}     ")
    text.append(
        f"{_number(row.damping_x, '9.0f')}  {_number(row.stiffness_x, '11.0f')}  {_number(row.velocity_x, '5.2f')}"
    )
    return text


def _number(value: float, form: str) -> str:
    width = int(form.partition(".")[0])
    return "-".rjust(width) if math.isnan(value) else f"{value:{form}}"


def _bar(share: float) -> str:
    """Return six characters that fill with `share`."""
    filled = 0 if math.isnan(share) else round(6 * min(max(share, 0.0), 1.0))
    return "#" * filled + "." * (6 - filled)
