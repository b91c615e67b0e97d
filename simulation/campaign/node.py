"""A listener on the wire of a trial: what vision foresaw, beside what the controller made of it."""

from __future__ import annotations

from collections.abc import Callable

from bridge.inbox import Inbox
from bridge.messages import FallHorizon, NodeStatus
from bridge.node import Factory, Node, NodeContext
from bridge.topics import FALL_HORIZON

Heard = Callable[[int, FallHorizon], None]


class HorizonListener:
    """Hands every usable horizon on with the time at which it came."""

    period_s: float | None = None

    def __init__(self, context: NodeContext, heard: Heard) -> None:
        self._inbox = Inbox[FallHorizon](context.transport, FALL_HORIZON, depth=8)
        self._heard = heard

    def step(self, now_ns: int) -> None:
        """Take what has come."""
        for horizon in self._inbox.drain(now_ns):
            if horizon.valid:
                self._heard(now_ns, horizon)

    def wait(self) -> None:
        """Stepped in simulated time only."""

    def status(self, now_ns: int) -> NodeStatus:
        """Say nothing of note."""
        return NodeStatus(stamp_ns=now_ns, role="listener", level=0, summary="listens")

    def finished(self) -> bool:
        """Never."""
        return False

    def close(self) -> None:
        """Leave the wire."""
        self._inbox.close()


def listening(heard: Heard) -> Factory:
    """Return what makes a listener."""

    def factory(context: NodeContext) -> Node:
        return HorizonListener(context, heard)

    return factory
