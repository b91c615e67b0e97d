"""The loop around a node, in time that the test owns: phase kept, turns missed and never queued, garbage in between."""

from __future__ import annotations

import gc
import logging
import os
from collections.abc import Callable

import pytest

from bridge.clock import NS, ManualClock
from bridge.codec import decode
from bridge.loop import run_loop
from bridge.messages import NodeStatus
from bridge.outbox import Outbox
from bridge.realtime import Collector, raise_priority
from bridge.topics import DIAGNOSTICS
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub

MS = 1_000_000
START_NS = 1000 * NS


class Clock(ManualClock):
    """Wakes up late where told to."""

    def __init__(self) -> None:
        super().__init__(START_NS)
        self.oversleeps_ns: Callable[[int], int] = lambda _: 0

    def sleep_until(self, when_ns: int) -> None:
        super().sleep_until(when_ns + self.oversleeps_ns(when_ns))


class Toy:
    """A node whose turns take as long as told."""

    def __init__(self, clock: ManualClock, turns: int, takes_ns: Callable[[int], int], period_s: float | None) -> None:
        self.clock, self.turns, self.takes_ns, self.period_s = clock, turns, takes_ns, period_s
        self.begun_ns: list[int] = []
        self.collecting: list[bool] = []

    def step(self, now_ns: int) -> None:
        self.begun_ns.append(now_ns - START_NS)
        self.collecting.append(gc.isenabled())
        self.clock.advance(self.takes_ns(len(self.begun_ns) - 1) / NS)

    def wait(self) -> None:
        self.clock.advance(0.002)

    def status(self, now_ns: int) -> NodeStatus:
        return NodeStatus(stamp_ns=now_ns, role="toy", level=0, summary="", values={"own": "1"})

    def finished(self) -> bool:
        return len(self.begun_ns) >= self.turns

    def close(self) -> None:
        pass


def run(
    turns: int,
    takes_ms: Callable[[int], float] = lambda _: 1.0,
    period_s: float | None = 0.01,
    oversleeps_ns: Callable[[int], int] = lambda _: 0,
) -> tuple[Toy, list[NodeStatus]]:
    clock = Clock()
    clock.oversleeps_ns = oversleeps_ns
    hub = MemoryHub(clock)
    sent: list[Sample] = []
    hub.transport().subscribe(DIAGNOSTICS, sent.append)
    toy = Toy(clock, turns, lambda k: round(takes_ms(k) * MS), period_s)
    run_loop(toy, Outbox(hub.transport(), DIAGNOSTICS), clock, lambda: False, logging.getLogger("toy"), "ordinary")
    return toy, [decode(DIAGNOSTICS, sample.payload) for sample in sent]


def test_turns_are_on_time() -> None:
    toy, statuses = run(101)
    assert toy.begun_ns == [k * 10 * MS for k in range(101)]
    assert statuses[-1].values["missed_periods"] == "0"


def test_one_long_turn_is_not_followed_by_a_burst_and_the_phase_stays() -> None:
    toy, statuses = run(60, lambda k: 37.0 if k == 10 else 1.0)
    assert toy.begun_ns[:11] == [k * 10 * MS for k in range(11)]
    # the turns due at 110 and 120 ms are missed; the one due at 130 begins late, within its period
    assert toy.begun_ns[11:14] == [137 * MS, 140 * MS, 150 * MS]
    assert statuses[-1].values["missed_periods"] == "2"


def test_under_steady_overload_turns_stay_on_the_grid() -> None:
    toy, statuses = run(200, lambda _: 15.0)
    late = [begun % (10 * MS) for begun in toy.begun_ns]
    assert set(late) <= {0, 5 * MS}
    span = toy.begun_ns[-1] // (10 * MS) + 1
    assert int(statuses[-1].values["missed_periods"]) == pytest.approx(span - 200, abs=20)


def test_waking_up_late_does_not_move_the_phase() -> None:
    toy, _ = run(100, oversleeps_ns=lambda when: 3 * MS if when % (70 * MS) == 0 else 80_000)
    for k, begun in enumerate(toy.begun_ns[1:], start=1):
        assert k * 10 * MS <= begun <= k * 10 * MS + 3 * MS


def test_status_has_what_the_node_and_what_the_loop_knows() -> None:
    _, statuses = run(101, lambda k: 4.0 if k == 50 else 1.0)
    values = statuses[-1].values
    assert values["own"] == "1"
    assert values["scheduling"] == "ordinary"
    assert (values["turn_ms.p50"], values["turn_ms.max"]) == ("1.000", "4.000")
    assert len(statuses) == 6  # one second at 5 Hz


def test_the_end_says_how_it_went(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        run(100, lambda k: 25.0 if k == 10 else 1.0)
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.startswith("100 turns in 1.0 s, 1 periods missed; a turn took p50 1.00")


def test_a_node_without_a_period_paces_itself() -> None:
    toy, statuses = run(200, period_s=None)
    assert toy.begun_ns[:3] == [0, 3 * MS, 6 * MS]
    assert statuses[0].values == {"own": "1"}
    assert len(statuses) == 3


def test_it_stops_when_told_to() -> None:
    clock = Clock()
    hub = MemoryHub(clock)
    toy = Toy(clock, 10**9, lambda _: MS, 0.01)
    outbox = Outbox(hub.transport(), DIAGNOSTICS)
    run_loop(toy, outbox, clock, lambda: len(toy.begun_ns) >= 5, logging.getLogger("toy"), "ordinary")
    assert len(toy.begun_ns) == 5


class TestGarbage:
    def test_no_turn_is_interrupted_and_afterwards_all_is_as_before(self) -> None:
        assert gc.isenabled()
        toy, _ = run(50)
        assert not any(toy.collecting)
        assert gc.isenabled()

    def test_an_error_of_the_node_gives_the_collection_back(self) -> None:
        def fail(_: int) -> float:
            raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            run(1, fail)
        assert gc.isenabled()

    @pytest.fixture
    def collected(self, monkeypatch: pytest.MonkeyPatch) -> list[int]:
        calls: list[int] = []
        monkeypatch.setattr(gc, "collect", lambda *_: calls.append(1))
        return calls

    def test_once_a_second_where_there_is_room(self, collected: list[int]) -> None:
        run(1001, lambda _: 2.0)
        assert 9 <= len(collected) <= 10

    def test_not_in_a_pause_too_short_until_it_is_overdue(self, collected: list[int]) -> None:
        run(2501, lambda _: 8.0)
        assert len(collected) == 2

    def test_a_loop_that_never_pauses_collects_too(self) -> None:
        collector = Collector(0)
        for second in range(1, 10):
            collector.pause(second * NS, second * NS)
        assert collector._last_ns == 0
        collector.pause(10 * NS, 10 * NS)
        assert collector._last_ns == 10 * NS


class TestPriority:
    def test_none_is_asked_for(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(os, "sched_setscheduler", lambda *_: pytest.fail("not asked for"))
        assert raise_priority(0) == "ordinary"

    def test_every_thread_gets_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        raised: list[tuple[int, int]] = []
        monkeypatch.setattr(os, "sched_setscheduler", lambda thread, _, param: raised.append((thread, param)))
        monkeypatch.setattr(os, "sched_param", int)
        assert raise_priority(20) == "SCHED_FIFO 20"
        assert (os.getpid(), 20) in raised

    @pytest.mark.parametrize(
        ("error", "words"),
        [
            (PermissionError(), "ordinary: SCHED_FIFO 20 is not permitted (needs CAP_SYS_NICE, or an rtprio limit"),
            (OSError(22, "Invalid argument"), "ordinary: SCHED_FIFO 20 refused: Invalid argument"),
        ],
    )
    def test_what_is_not_permitted_is_said(self, monkeypatch: pytest.MonkeyPatch, error: OSError, words: str) -> None:
        def refuse(*_: object) -> None:
            raise error

        monkeypatch.setattr(os, "sched_setscheduler", refuse)
        assert raise_priority(20).startswith(words)
