"""Replaying a recording over the wire, in the place of the processes that published it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import ExitStack, closing
from typing import Final, NamedTuple, Self

from bridge.clock import Clock, nanoseconds, seconds
from bridge.codec import decode
from bridge.config.bridge import BridgeConfig, is_loopback
from bridge.errors import InvalidMessage, TransportError
from bridge.launch.ports import require_free
from bridge.record.reader import Recorded, Recording
from bridge.record.rebase import TimeMap, rebase
from bridge.record.roles import INPUTS
from bridge.topics import Topic
from bridge.transport.interface import Publisher, Transport
from bridge.transport.zenoh import ZenohTransport

LOOK_S: Final = 0.05  # how often a wait looks whether it is to end


def confined(config: BridgeConfig) -> BridgeConfig:
    """Return `config` without the ways that lead off this machine: no routers, no clients of routers.

    Raises:
        TransportError: its endpoints themselves are elsewhere.
    """
    for endpoint in (*config.endpoints.values(), *config.connect):
        if not is_loopback(endpoint):
            raise TransportError(f"a replay stays on this machine, and {endpoint} does not: --config another file")
    return config.model_copy(update={"connect": (), "mode": "peer"})


class StandIns:
    """One session per role whose messages are replayed, each at that role's endpoint.

    A live process of such a role finds its port in use, and a replay does not begin while one
    runs, so that recorded and live messages never mix. Commands are replayed too, and a drive
    would follow them: replay stays on this machine.
    """

    def __init__(self, config: BridgeConfig, roles: Iterable[str], clock: Clock) -> None:
        """Open the sessions.

        Raises:
            TransportError: an endpoint is taken, or the configuration leaves this machine.
        """
        wanted = [role for role in INPUTS if role in set(roles)]
        config = confined(config)
        for role in wanted:
            if role not in config.endpoints:
                raise TransportError(f"bridge.endpoints.{role} is elsewhere, and a replay stays on this machine")
        require_free(config.endpoints, wanted)
        self._stack = ExitStack()
        self._transports: dict[str, Transport] = {}
        self._publishers: dict[tuple[str, bytes], Publisher] = {}
        self._alive: dict[str, dict[str, bool]] = {role: {} for role in wanted}  # stand-in -> what it sees
        with ExitStack() as stack:
            for role in wanted:
                transport = self._transports[role] = stack.enter_context(closing(ZenohTransport(config, role, clock)))
                transport.watch_alive(self._alive[role].__setitem__)
                transport.declare_alive(role)
            self._stack = stack.pop_all()

    def put(self, recorded: Recorded, payload: bytes, stamp_ns: int) -> None:
        """Publish `payload` as the publisher of `recorded` did."""
        key = (recorded.topic.key, recorded.sample.source)
        if key not in self._publishers:
            self._publishers[key] = self._transport(recorded).publisher(recorded.topic)
        self._publishers[key].put(payload, stamp_ns)

    def all_see(self, roles: Iterable[str]) -> bool:
        """Whether every session has a link to every process of `roles`."""
        return all(seen.get(role, False) for role in roles for seen in self._alive.values())

    def close(self) -> None:
        """Leave the wire."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _transport(self, recorded: Recorded) -> Transport:
        role = recorded.topic.publisher
        if role == "*":
            try:
                role = decode(recorded.topic, recorded.sample.payload).role
            except InvalidMessage:
                role = ""
        return self._transports.get(role) or next(iter(self._transports.values()))


class Pace(NamedTuple):
    """How a replay moves through the recording."""

    rate: float  # replayed seconds of the recording per second
    delay_s: float  # before the first message, for readers to connect [s]


class Played(NamedTuple):
    """What went over the wire."""

    sent: Mapping[str, int]  # messages by key
    latest_s: float  # the most that a message was behind its time [s]


def play(
    recording: Recording,
    topics: Collection[Topic],
    stand_ins: StandIns,
    pace: Pace,
    clock: Clock,
    watch: Callable[[float], bool],
) -> Played:
    """Publish the messages of `topics` with the recording's spacing divided by `pace.rate`.

    Args:
        recording: what to publish.
        topics: which of its topics.
        stand_ins: where to publish.
        pace: how fast.
        clock: real time.
        watch: is told before every message and at least every 50 ms how much was read, 0..1; true ends the replay.

    Raises:
        SourceError: the recording cannot be read.
    """
    keys = {topic.key for topic in topics}
    sent: Counter[str] = Counter()
    latest_ns = 0
    times: TimeMap | None = None
    for recorded in recording.samples():  # of every topic: the replay begins where the recording does
        if times is None:
            times = TimeMap(recorded.log_time_ns, clock.now_ns() + nanoseconds(pace.delay_s), pace.rate)
        if recorded.topic.key not in keys:
            continue
        due_ns = times.to_now(recorded.log_time_ns)
        while True:
            if watch(recording.progress):
                return Played(sent, seconds(latest_ns))
            left_ns = due_ns - clock.now_ns()
            if left_ns <= 0:
                break
            clock.sleep_until(due_ns - max(left_ns - nanoseconds(LOOK_S), 0))
        latest_ns = max(latest_ns, -left_ns)
        payload, stamp_ns = rebase(recorded.topic, recorded.sample.payload, times)
        stand_ins.put(recorded, payload, stamp_ns)
        sent[recorded.topic.key] += 1
    return Played(sent, seconds(latest_ns))
