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
    put(inbox, b"a", 900, START, x=1)
    assert force(inbox, START) == 1
    later = clock.advance(0.1)  # longer than a publisher may be silent
    put(inbox, b"b", 0, later, x=2, stamp_ns=START - 5_000_000)
    assert force(inbox, later) == 1
    put(inbox, b"c", 0, later + 1_000_000, x=3)
    assert force(inbox, later + 1_000_000) == 3


def put(inbox: Inbox[Wrench], source: bytes, number: int, at_ns: int, x: float, stamp_ns: int | None = None) -> None:
    payload = encode(WRENCH, wrench(at_ns if stamp_ns is None else stamp_ns, x))
    inbox._store(Sample(payload, number, source * 16, at_ns))


def force(inbox: Inbox[Wrench], now_ns: int) -> float | None:
    message = inbox.read(now_ns).message
    return None if message is None else float(message.force[0])


def test_a_publisher_that_was_silent_may_say_more_about_the_same_moment(hub: MemoryHub, clock: ManualClock) -> None:
    """As anticipation does: without keypoints it says, by the stamp of the last ones, that its horizon is not valid."""
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    put(inbox, b"a", 7, START, x=1)
    assert force(inbox, START) == 1
    later = clock.advance(0.2)
    put(inbox, b"a", 8, later, x=2, stamp_ns=START)
    assert force(inbox, later) == 2


def test_of_two_publishers_the_first_is_followed_and_the_other_named(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    for number in range(20):
        now = clock.advance(0.01)
        put(inbox, b"a", number, now, x=1)
        assert force(inbox, now) == 1
        assert (inbox.rival(now) == "") == (number < 6)
        if number >= 5:
            put(inbox, b"b", number, now + 1, x=2)
            inbox._store(Sample(b"garbage", number, b"c" * 16, now + 2))
        assert force(inbox, now + 3) == 1
        assert inbox.read(now + 3).ok, "what others send is not this stream's fault"
    assert inbox.rival(now) == "two publishers of wrench: the first is followed, the other refused"


def test_a_flood_by_another_crowds_nobody_out(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    put(inbox, b"a", 0, clock.now_ns(), x=1)
    assert force(inbox, clock.now_ns()) == 1
    for number in range(1, 10):
        now = clock.advance(0.01)
        put(inbox, b"a", number, now, x=number)
        for flood in range(100):
            put(inbox, b"b", flood, now + flood, x=99)
        assert force(inbox, now + 200) == number


def test_the_other_publisher_takes_over_when_the_first_falls_silent(hub: MemoryHub, clock: ManualClock) -> None:
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    put(inbox, b"a", 0, START, x=1)
    assert force(inbox, START) == 1
    followed = []
    for number in range(12):
        now = clock.advance(0.01)
        put(inbox, b"b", number, now, x=2)
        followed.append(force(inbox, now))
    assert followed == [1.0] * 6 + [2.0] * 6, "60 ms is what a wrench may be old"
    assert inbox.rival(now), "said for a second"
    assert inbox.rival(clock.advance(1.1)) == ""


def test_a_publisher_without_a_name_is_followed_like_any_other(hub: MemoryHub, clock: ManualClock) -> None:
    """A node of ROS 2 behind a bridge attaches none; whoever attaches one does not displace it by that."""
    inbox = Inbox[Wrench](hub.transport(), WRENCH)
    put(inbox, b"", -1, START, x=1)
    assert force(inbox, START) == 1
    now = clock.advance(0.01)
    put(inbox, b"b", 0, now, x=2)
    assert force(inbox, now) == 1
    assert inbox.rival(now) == "two publishers of wrench: the first is followed, the other refused"
    now = clock.advance(0.1)
    put(inbox, b"b", 1, now, x=2)
    assert force(inbox, now) == 2, "the first fell silent"


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
