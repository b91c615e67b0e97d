"""What went over the wire, as columns over the recording's time.

Pure: messages in, numbers out. A stream that is silent, older than its topic allows
or invalid leaves gaps (NaN), never zeros and never its last value.
"""

from __future__ import annotations

import bisect
import csv
import math
from collections.abc import Iterator
from io import StringIO
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from bridge.clock import NS
from bridge.errors import InvalidMessage
from bridge.messages import STEPS, FallHorizon, Floats, Keypoints, Message, Odometry, SupportCommand, Wrench
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic

M = TypeVar("M", bound=Message)
NAN: Final = float("nan")
ROUNDING_NS: Final = 1000  # seconds in floating point find the message stamped at that very time
AHEAD: Final = STEPS - 1  # the last step of the horizon, 500 ms


class Row(NamedTuple):
    """The system at one moment; NaN or '' where nothing usable was on the wire."""

    time_s: float  # since the recording's first frame [s]
    state: str
    solver: str
    stiffening: float
    damping_x: float  # [N s/m]
    stiffness_x: float  # [N/m]
    command_x: float  # commanded forward velocity [m/s]
    command_height: float  # commanded column height [m]
    stable: float  # probability now
    transient: float
    fall: float
    stable_ahead: float  # probability in 500 ms
    transient_ahead: float
    fall_ahead: float
    distance: float  # to the fall boundary now [within-class sd]
    distance_ahead: float  # in 500 ms
    quality: float  # of the horizon
    velocity_x: float  # measured forward velocity [m/s]
    height: float  # measured column height [m]
    force_x: float  # at the interface [N]
    force_z: float  # [N]
    reason: str


class Snapshot(NamedTuple):
    """A skeleton, where the horizon says it will be in 500 ms, and where it was then [px]."""

    time_s: float
    present_px: Floats  # (12, 2), NaN where lost
    forecast_px: Floats  # (12, 2), NaN without a horizon
    later_px: Floats  # (12, 2), NaN where unknown


class Recorder:
    """Keeps every message of the streams that a timeline is made of."""

    def __init__(self) -> None:
        self.origin_ns: int | None = None
        self.keypoints: _Stream[Keypoints] = _Stream(KEYPOINTS)
        self.horizons: _Stream[FallHorizon] = _Stream(FALL_HORIZON)
        self.commands: _Stream[SupportCommand] = _Stream(SUPPORT_COMMAND)
        self.odometry: _Stream[Odometry] = _Stream(ODOMETRY)
        self.wrenches: _Stream[Wrench] = _Stream(WRENCH)
        self._latency_s: list[float] = []
        self._rested_on_ns = 0

    def add(self, message: Message, arrival_ns: int | None = None) -> None:
        """Take in one message; the first valid keypoints of a recording set the origin of time.

        Args:
            message: of any stream; those that a timeline does not show are ignored.
            arrival_ns: when it arrived here; None if that is not known.
        """
        match message:
            case Keypoints():
                if self.origin_ns is None and message.valid:
                    self.origin_ns = message.stamp_ns - round(message.sequence * message_period_ns())
                self.keypoints.add(message)
            case FallHorizon():
                self.horizons.add(message)
            case SupportCommand():
                self.commands.add(message)
                self._time(message, arrival_ns)
            case Odometry():
                self.odometry.add(message)
            case Wrench():
                self.wrenches.add(message)

    @property
    def latency_s(self) -> Floats:
        """From each frame to the arrival of the first command that rests on it [s]."""
        return np.array(self._latency_s)

    def time_s(self, stamp_ns: int) -> float:
        """Return the recording's time of a stamp; NaN before the first keypoints."""
        return NAN if self.origin_ns is None else (stamp_ns - self.origin_ns) / NS

    def row(self, time_s: float) -> Row:
        """Return the system at `time_s`."""
        at_ns = (self.origin_ns or 0) + round(time_s * NS)
        command, horizon = self.commands.at(at_ns), self.horizons.at(at_ns)
        odometry, wrench = self.odometry.at(at_ns), self.wrenches.at(at_ns)
        return Row(
            time_s=time_s,
            state="" if command is None else command.state.value,
            solver="" if command is None else command.solver,
            stiffening=NAN if command is None else command.stiffening,
            damping_x=NAN if command is None else float(command.damping[0]),
            stiffness_x=NAN if command is None else float(command.stiffness[0]),
            command_x=NAN if command is None else float(command.velocity[0]),
            command_height=NAN if command is None else command.column_height,
            **_fall(horizon),
            velocity_x=NAN if odometry is None else float(odometry.velocity[0]),
            height=NAN if odometry is None else float(odometry.position[2]),
            force_x=NAN if wrench is None else float(wrench.force[0]),
            force_z=NAN if wrench is None else float(wrench.force[2]),
            reason="" if command is None else command.reason,
        )

    def rows(self, period_s: float, end_s: float | None = None) -> list[Row]:
        """Return the system every `period_s` from the first frame on, up to `end_s` or the last message."""
        if self.origin_ns is None:
            return []
        last_s = max((self.time_s(s.last_ns) for s in (self.commands, self.horizons, self.odometry)), default=0.0)
        last_s = last_s if end_s is None else min(last_s, end_s)
        return [self.row(step * period_s) for step in range(math.floor(last_s / period_s + 1e-9) + 1)]

    def snapshot(self, time_s: float) -> Snapshot:
        """Return the skeleton at `time_s` with its forecast and what became of it."""
        at_ns = (self.origin_ns or 0) + round(time_s * NS)
        horizon = self.horizons.at(at_ns)
        forecast = np.full((12, 2), NAN) if horizon is None else horizon.forecast_px[AHEAD]
        step_ns = 0 if horizon is None else round(AHEAD * horizon.step_s * NS)
        rests_ns = at_ns if horizon is None else horizon.stamp_ns
        later = self._position(rests_ns + step_ns) if horizon is not None else np.full((12, 2), NAN)
        return Snapshot(time_s, self._position(rests_ns), forecast, later)

    def _position(self, at_ns: int) -> Floats:
        keypoints = self.keypoints.at(at_ns)
        return np.full((12, 2), NAN) if keypoints is None else keypoints.position_px

    def _time(self, command: SupportCommand, arrival_ns: int | None) -> None:
        if arrival_ns is not None and command.rests_on_ns > self._rested_on_ns:
            self._rested_on_ns = command.rests_on_ns
            self._latency_s.append((arrival_ns - command.rests_on_ns) / NS)


def to_csv(rows: list[Row]) -> str:
    """Return the rows as CSV, numbers with six significant digits, gaps as `nan`."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Row._fields)
    for row in rows:
        writer.writerow([f"{value:.6g}" if isinstance(value, float) else value for value in row])
    return text.getvalue()


def message_period_ns() -> float:
    """Return the time between two ticks of the keypoints' clock [ns]."""
    return NS / KEYPOINTS.rate_hz


class Ticker:
    """Decides which moments of a running system are worth a line: every `period_s`, and each change of state."""

    def __init__(self, recorder: Recorder, period_s: float = 0.5) -> None:
        self._recorder, self._period_s = recorder, period_s
        self._seen = 0
        self._due_s = 0.0
        self._state = ""

    def new(self) -> Iterator[tuple[Row, bool]]:
        """Give the moments since the last call, each with whether the state changed there."""
        commands = self._recorder.commands
        while self._recorder.origin_ns is not None and self._seen < len(commands.stamps_ns):
            time_s = self._recorder.time_s(commands.stamps_ns[self._seen])
            message = commands.messages[self._seen]
            self._seen += 1
            if time_s < 0.0 or message is None:
                continue
            changed = message.state.value != self._state
            if changed or time_s >= self._due_s:
                self._state = message.state.value
                self._due_s = (math.floor(time_s / self._period_s) + 1) * self._period_s
                yield self._recorder.row(time_s), changed


class _Stream(Generic[M]):
    """Messages of one topic in the order of their stamps; None where one was not to be used."""

    def __init__(self, topic: Topic) -> None:
        self._max_age_ns = round(topic.max_age_s * NS)
        self.stamps_ns: list[int] = []
        self.messages: list[M | None] = []

    @property
    def last_ns(self) -> int:
        return self.stamps_ns[-1] if self.stamps_ns else 0

    def add(self, message: M) -> None:
        """Take in a message; one older than what is there was overtaken and is dropped."""
        if self.stamps_ns and message.stamp_ns < self.stamps_ns[-1]:
            return
        usable: M | None = message
        try:
            message.check()
        except InvalidMessage:
            usable = None
        self.stamps_ns.append(message.stamp_ns)
        self.messages.append(usable)

    def at(self, at_ns: int) -> M | None:
        """Return the newest message stamped at or before `at_ns`; None if it is too old or not to be used."""
        index = bisect.bisect_right(self.stamps_ns, at_ns + ROUNDING_NS) - 1
        if index < 0 or at_ns - self.stamps_ns[index] > self._max_age_ns:
            return None
        return self.messages[index]


_FALL_FIELDS: Final = Row._fields[Row._fields.index("stable") : Row._fields.index("quality") + 1]


def _fall(horizon: FallHorizon | None) -> dict[str, float]:
    if horizon is None:
        return dict.fromkeys(_FALL_FIELDS, NAN)
    now, ahead = horizon.probabilities[0].tolist(), horizon.probabilities[AHEAD].tolist()
    distance = float(horizon.distance[0]), float(horizon.distance[AHEAD])
    return dict(zip(_FALL_FIELDS, (*now, *ahead, *distance, horizon.quality), strict=True))
