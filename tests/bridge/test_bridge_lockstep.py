"""Nodes in simulated time: each at its own rate, and what happens at an instant reaches the output of that instant."""

from __future__ import annotations

import sys
import types
from typing import Any

import pytest

from bridge.clock import NS
from bridge.config.surefoot import SurefootConfig
from bridge.inbox import Inbox
from bridge.lockstep import LockStep
from bridge.messages import NodeStatus, Wrench
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import WRENCH

START_NS = 5 * NS
MS = 1_000_000


class Talker:
    """Says the time whenever it is stepped."""

    period_s: float | None = None

    def __init__(self, context: NodeContext) -> None:
        self.outbox = Outbox(context.transport, WRENCH)

    def step(self, now_ns: int) -> None:
        self.outbox.send(Wrench(stamp_ns=now_ns, force=[1, 0, 0], torque=[0, 0, 0]))

    def wait(self) -> None: ...

    def status(self, now_ns: int) -> NodeStatus:
        return NodeStatus(stamp_ns=now_ns, role="x", level=0, summary="")

    def finished(self) -> bool:
        return False

    def close(self) -> None: ...


class Listener(Talker):
    """Notes, a hundred times a second, what it has heard."""

    period_s = 0.01

    def __init__(self, context: NodeContext) -> None:
        self.inbox = Inbox[Wrench](context.transport, WRENCH)
        self.turns: list[tuple[int, int | None]] = []
        HEARD.append(self)

    def step(self, now_ns: int) -> None:
        message = self.inbox.read(now_ns).message
        self.turns.append((now_ns, None if message is None else message.stamp_ns))


HEARD: list[Listener] = []


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> LockStep:
    for name, kind in (("toy_talker", Talker), ("toy_listener", Listener)):
        module: Any = types.ModuleType(name)
        module.create = kind
        monkeypatch.setitem(sys.modules, name, module)
    HEARD.clear()
    return LockStep(SurefootConfig(), {"talker": ("toy_talker", {}), "listener": ("toy_listener", {})}, START_NS)


def test_periodic_nodes_keep_their_rate_between_events(system: LockStep) -> None:
    system.advance_to(START_NS)
    system.advance_to(START_NS + 35 * MS)
    assert [now_ns - START_NS for now_ns, _ in HEARD[0].turns] == [0, 10 * MS, 20 * MS, 30 * MS]
    assert {heard for _, heard in HEARD[0].turns} == {START_NS}


def test_settling_brings_an_instant_to_the_output_of_that_instant(system: LockStep) -> None:
    for frame in range(4):
        when_ns = START_NS + round(frame * NS / 30)
        system.advance_to(when_ns)
        assert not HEARD[0].turns or HEARD[0].turns[-1][1] != when_ns
        system.settle()
        assert HEARD[0].turns[-1][1] == when_ns
    assert [now_ns for now_ns, _ in HEARD[0].turns] == [START_NS + k * 10 * MS for k in range(len(HEARD[0].turns))]


def test_settling_twice_does_not_run_ahead(system: LockStep) -> None:
    system.advance_to(START_NS + 1)
    for _ in range(5):
        system.settle()
    assert HEARD[0].turns[-1][0] <= START_NS + 20 * MS
