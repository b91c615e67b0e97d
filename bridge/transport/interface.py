"""What a node needs from the wire, and nothing more."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from bridge.topics import Topic


class Sample(NamedTuple):
    """Bytes as they arrived, with what the sender attached to them."""

    payload: bytes
    sequence: int  # counts up by one per publisher; -1 if the sender attached none
    source: bytes  # identifies the publisher instance; a restart changes it
    arrival_ns: int  # reader's clock when the bytes arrived [ns]


class Publisher(Protocol):
    """A stream this process may write."""

    def put(self, payload: bytes, stamp_ns: int) -> None:
        """Send `payload`; never blocks the caller on a slow reader."""
        ...

    def close(self) -> None:
        """Stop publishing."""
        ...


class Handle(Protocol):
    """Something that was declared and can be taken back."""

    def close(self) -> None:
        """Take it back."""
        ...


class Transport(Protocol):
    """One process's door to the wire."""

    def publisher(self, topic: Topic) -> Publisher:
        """Declare that this process writes `topic`."""
        ...

    def subscribe(self, topic: Topic, callback: Callable[[Sample], None]) -> Handle:
        """Call `callback` with every sample of `topic`; it must only store the sample and return."""
        ...

    def declare_alive(self, role: str) -> Handle:
        """Announce that `role` is running, until closed or the process dies."""
        ...

    def watch_alive(self, callback: Callable[[str, bool], None]) -> Handle:
        """Call `callback(role, alive)` for every role now and whenever that changes."""
        ...

    def close(self) -> None:
        """Leave the wire."""
        ...
