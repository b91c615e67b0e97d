"""A wire inside one process: synchronous, ordered, no threads. For tests, replays and lock-step simulation."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable

from bridge.clock import Clock
from bridge.topics import Topic
from bridge.transport.interface import Sample

_Callback = Callable[[Sample], None]
_AliveCallback = Callable[[str, bool], None]


class MemoryHub:
    """What the transports of one simulated network share."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.subscribers: dict[str, list[_Callback]] = defaultdict(list)
        self.alive: dict[str, int] = defaultdict(int)
        self.alive_callbacks: list[_AliveCallback] = []
        self._sources = itertools.count(1)

    def transport(self) -> MemoryTransport:
        """Return a new door to this hub."""
        return MemoryTransport(self)

    def deliver(self, topic: Topic, sample: Sample) -> None:
        """Hand `sample` to every subscriber of `topic`."""
        for callback in tuple(self.subscribers[topic.key]):
            callback(sample)

    def next_source(self) -> bytes:
        """Return an identifier no publisher of this hub had before."""
        return next(self._sources).to_bytes(16, "little")

    def mark(self, role: str, change: int) -> None:
        """Count a process of `role` in (+1) or out (-1) and tell the watchers when that changes liveness."""
        before = self.alive[role] > 0
        self.alive[role] += change
        after = self.alive[role] > 0
        if before != after:
            for callback in tuple(self.alive_callbacks):
                callback(role, after)


class _Undo:
    """Runs an action once."""

    def __init__(self, action: Callable[[], None]) -> None:
        self._action: Callable[[], None] | None = action

    def close(self) -> None:
        if self._action is not None:
            action, self._action = self._action, None
            action()


class _MemoryPublisher:
    def __init__(self, hub: MemoryHub, topic: Topic) -> None:
        self._hub, self._topic, self._source, self._sequence = hub, topic, hub.next_source(), 0
        self._open = True

    def put(self, payload: bytes, stamp_ns: int) -> None:  # noqa: ARG002 (the stamp travels inside the payload here)
        if not self._open:
            return
        sample = Sample(payload, self._sequence, self._source, self._hub.clock.now_ns())
        self._sequence += 1
        self._hub.deliver(self._topic, sample)

    def close(self) -> None:
        self._open = False


class MemoryTransport:
    """`Transport` over a `MemoryHub`."""

    def __init__(self, hub: MemoryHub) -> None:
        self._hub = hub
        self._handles: list[_Undo | _MemoryPublisher] = []

    def publisher(self, topic: Topic) -> _MemoryPublisher:
        """Return a publisher whose samples arrive before `put` returns."""
        publisher = _MemoryPublisher(self._hub, topic)
        self._handles.append(publisher)
        return publisher

    def subscribe(self, topic: Topic, callback: _Callback) -> _Undo:
        """Call `callback` with every sample put on `topic` from now on."""
        listeners = self._hub.subscribers[topic.key]
        listeners.append(callback)
        return self._keep(_Undo(lambda: listeners.remove(callback)))

    def declare_alive(self, role: str) -> _Undo:
        """Announce `role` until closed."""
        self._hub.mark(role, +1)
        return self._keep(_Undo(lambda: self._hub.mark(role, -1)))

    def watch_alive(self, callback: _AliveCallback) -> _Undo:
        """Call `callback` for the roles alive now and at every change."""
        self._hub.alive_callbacks.append(callback)
        for role, count in tuple(self._hub.alive.items()):
            if count > 0:
                callback(role, True)
        return self._keep(_Undo(lambda: self._hub.alive_callbacks.remove(callback)))

    def close(self) -> None:
        """Withdraw everything this transport declared."""
        for handle in reversed(self._handles):
            handle.close()
        self._handles.clear()

    def _keep(self, handle: _Undo) -> _Undo:
        self._handles.append(handle)
        return handle
