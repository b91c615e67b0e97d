"""Watching the processes from the outside, over the wire they use themselves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from bridge.clock import NS, Clock
from bridge.inbox import Inbox, Reading
from bridge.messages import FallHorizon, NodeStatus, SupportCommand
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, SUPPORT_COMMAND
from bridge.transport.interface import Transport


class RoleView(NamedTuple):
    """What one role says about itself."""

    alive: bool  # by its liveliness token
    status: NodeStatus | None
    age_s: float  # of the status [s]; inf without one


class View(NamedTuple):
    """The wire at one moment."""

    roles: Mapping[str, RoleView]
    command: Reading[SupportCommand]
    horizon: Reading[FallHorizon]


class Monitor:
    """Listens to statuses, commands and horizons; publishes nothing, so that its end changes nothing."""

    def __init__(self, transport: Transport, clock: Clock) -> None:
        self._clock = clock
        self._alive: dict[str, bool] = {}
        self._statuses: dict[str, NodeStatus] = {}
        self._diagnostics: Inbox[NodeStatus] = Inbox(transport, DIAGNOSTICS, depth=64)
        self._command: Inbox[SupportCommand] = Inbox(transport, SUPPORT_COMMAND)
        self._horizon: Inbox[FallHorizon] = Inbox(transport, FALL_HORIZON)
        transport.watch_alive(self._alive.__setitem__)

    def look(self) -> View:
        """Take in what arrived and return how things stand."""
        now_ns = self._clock.now_ns()
        for status in self._diagnostics.drain(now_ns):
            self._statuses[status.role] = status
        names = sorted(self._alive.keys() | self._statuses.keys())
        return View(
            {name: self._role(name, now_ns) for name in names},
            self._command.read(now_ns),
            self._horizon.read(now_ns),
        )

    def _role(self, name: str, now_ns: int) -> RoleView:
        status = self._statuses.get(name)
        age_s = float("inf") if status is None else (now_ns - status.stamp_ns) / NS
        return RoleView(self._alive.get(name, False), status, age_s)
