"""An input is fresh, in order and valid, or its reader knows in words why not."""

from __future__ import annotations

import numpy as np
import pytest

from bridge.clock import NS, ManualClock
from bridge.codec import encode
from bridge.inbox import Inbox
from bridge.messages import NodeStatus, Wrench
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, WRENCH
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub

START = 100 * NS


def wrench(stamp_ns: int, x: float = 1.0) -> Wrench:
    return Wrench(stamp_ns=stamp_ns, force=[x, 0, 0], torque=[0, 0, 0])


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(START)


@pytest.fixture
def hub(clock: ManualClock) -> MemoryHub:
    return MemoryHub(clock)


def test_nothing_received_is_a_fault_with_a_name(hub: MemoryHub, clock: ManualClock) -> None:
    reading = Inbox[Wrench](hub.transport(), WRENCH).read(clock.now_ns())
    assert (reading.message, reading.age_s, reading.ok) == (None, np.inf, False)
    assert reading.fault == "no wrench received yet"


def test_age_is_judged_by_the_readers_clock(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH), Outbox(hub.transport(), WRENCH)
    outbox.send(wrench(clock.now_ns()))
    clock.advance(0.059)
    reading = inbox.read(clock.now_ns())
    assert reading.ok
    assert reading.fresh
    assert reading.age_s == pytest.approx(0.059)
    clock.advance(0.011)
    stale = inbox.read(clock.now_ns())
    assert stale.fault == "wrench is 70 ms old, limit 60"
    assert stale.message is not None
    assert not stale.fresh


def test_the_newest_sample_wins_and_late_ones_change_nothing(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    kept = []
    for number in (5, 7, 6, 7, 8, 2):
        # stamps rise all the while: only the number tells that a sample is late
        payload = encode(WRENCH, wrench(clock.advance(0.001) and clock.now_ns(), x=number))
        inbox._store(Sample(payload, number, b"a" * 16, clock.now_ns()))
        reading = inbox.read(clock.now_ns())
        assert reading.message is not None
        assert reading.ok
        kept.append((reading.message.force[0], reading.message.sequence, reading.fresh))
    late = [(7, 7, False), (7, 7, False)]
    assert kept == [(5, 5, True), (7, 7, True), *late, (8, 8, True), (8, 8, False)]
    assert inbox.refused == 3


def test_a_restarted_publisher_is_followed_but_a_replayed_old_one_is_not(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    inbox._store(Sample(encode(WRENCH, wrench(START, 1)), 900, b"a" * 16, START))
    assert inbox.read(START).message is not None
    inbox._store(Sample(encode(WRENCH, wrench(START - 5_000_000, 2)), 0, b"b" * 16, START))
    kept = inbox.read(START).message
    assert kept is not None
    assert kept.force[0] == 1
    inbox._store(Sample(encode(WRENCH, wrench(START + 1_000_000, 3)), 0, b"c" * 16, START))
    followed = inbox.read(START + 1_000_000).message
    assert followed is not None
    assert followed.force[0] == 3


def test_a_stamp_from_the_future_is_refused(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH), Outbox(hub.transport(), WRENCH)
    outbox.send(wrench(clock.now_ns() + NS))
    assert inbox.read(clock.now_ns()).fault == "wrench is stamped 1000 ms ahead, limit 50"
    outbox.send(wrench(clock.now_ns()))
    assert inbox.read(clock.now_ns()).ok


def test_what_arrives_while_the_reader_is_held_up_is_not_from_the_future(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH), Outbox(hub.transport(), WRENCH)
    turn_began_ns = clock.now_ns()
    outbox.send(wrench(clock.advance(0.2)))
    assert inbox.read(turn_began_ns).ok


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (b"", "does not decode"),
        (b"\x00\x01\x00\x00" + b"\xff" * 40, "does not decode"),
        (encode(WRENCH, wrench(START, np.nan)), "wrench force is not finite"),
    ],
)
def test_garbage_is_named_and_the_next_good_message_clears_it(
    hub: MemoryHub, clock: ManualClock, payload: bytes, says: str
) -> None:
    transport = hub.transport()
    inbox, outbox, raw = Inbox[Wrench](transport, WRENCH), Outbox(transport, WRENCH), transport.publisher(WRENCH)
    outbox.send(wrench(START - 1_000_000))
    raw.put(payload, START)
    reading = inbox.read(clock.now_ns())
    # only the newest sample counts: the good one before it was overwritten in the slot
    assert says in reading.fault
    assert not reading.fresh
    outbox.send(wrench(START + 2_000_000))
    assert inbox.read(START + 2_000_000).ok


def test_a_deep_inbox_hands_over_every_message_in_order(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH, depth=8), Outbox(hub.transport(), WRENCH)
    for x in range(12):
        outbox.send(wrench(clock.advance(0.001) and clock.now_ns(), x))
    assert [message.force[0] for message in inbox.drain(clock.now_ns())] == [4, 5, 6, 7, 8, 9, 10, 11]
    assert inbox.drain(clock.now_ns()) == []


def test_streams_that_every_role_writes_interleave(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[NodeStatus](hub.transport(), DIAGNOSTICS, depth=8)
    boxes = {role: Outbox(hub.transport(), DIAGNOSTICS) for role in ("perception", "controller")}
    boxes["perception"].send(NodeStatus(stamp_ns=START, role="perception", level=0, summary=""))
    boxes["controller"].send(NodeStatus(stamp_ns=START - 9, role="controller", level=0, summary=""))
    assert [status.role for status in inbox.drain(START)] == ["perception", "controller"]


def test_wait_returns_at_once_when_something_is_there(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH), Outbox(hub.transport(), WRENCH)
    assert not inbox.wait(0.0)
    outbox.send(wrench(START))
    assert inbox.wait(0.0)
    inbox.read(START)
    assert not inbox.wait(0.0)


def test_closed_ends_hear_and_say_nothing(hub: MemoryHub, clock: ManualClock) -> None:
    inbox, outbox = Inbox[Wrench](hub.transport(), WRENCH), Outbox(hub.transport(), WRENCH)
    inbox.close()
    outbox.send(wrench(START))
    assert inbox.read(START).message is None
    other = Inbox[Wrench](hub.transport(), WRENCH)
    outbox.close()
    outbox.send(wrench(START))
    assert other.read(START).message is None
