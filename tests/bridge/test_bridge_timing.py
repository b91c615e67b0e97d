"""How regularly a loop turns, and when its turns are due."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.timing import LoopTiming, RecentRate, Schedule, Spread

MS = 1_000_000


def test_before_the_second_turn() -> None:
    timing = LoopTiming(0.01)
    assert (timing.rate_hz(), timing.error_s.count) == (0.0, 0)
    timing.tick(5)
    assert (timing.rate_hz(), timing.error_s.count) == (0.0, 0)


def test_rate_and_error_of_the_period() -> None:
    timing = LoopTiming(0.01)
    now_ns = 0
    for k in range(201):
        timing.tick(now_ns)
        now_ns += (16 if k % 50 == 49 else 10) * MS
    assert timing.rate_hz() == pytest.approx(200 / (200 * 0.01 + 4 * 0.006))
    error = timing.error_s.percentiles()
    assert (error.p50, error.largest) == pytest.approx((0.0, 0.006))
    assert error.p99 == pytest.approx(0.006, abs=0.001)


def test_a_turn_that_comes_early_is_off_as_well() -> None:
    timing = LoopTiming(0.01)
    for now_ns in (0, 4 * MS):
        timing.tick(now_ns)
    assert timing.error_s.percentiles().largest == pytest.approx(0.006)


def test_old_turns_are_forgotten_but_for_the_worst() -> None:
    timing = LoopTiming(0.01, length=10)
    now_ns = 0
    for period_ms in [50] * 20 + [10] * 11:
        now_ns += period_ms * MS
        timing.tick(now_ns)
    assert timing.rate_hz() == pytest.approx(100.0)
    assert timing.error_s.percentiles() == pytest.approx((0.0, 0.0, 0.04))


def test_spread_says_milliseconds() -> None:
    spread = Spread()
    assert spread.report("solve") == {"solve_ms.p50": "0.000", "solve_ms.p99": "0.000", "solve_ms.max": "0.000"}
    for value in (0.001, 0.002, 0.003):
        spread.note(value)
    assert spread.report("solve")["solve_ms.p50"] == "2.000"
    assert spread.report("solve")["solve_ms.max"] == "3.000"


class TestSchedule:
    def begin(self, *nows_ms: float) -> Schedule:
        schedule = Schedule(0, 10 * MS)
        for now_ms in nows_ms:
            schedule.begin(round(now_ms * MS))
        return schedule

    def test_on_time(self) -> None:
        schedule = self.begin(0, 10, 20)
        assert (schedule.due_ns, schedule.missed) == (30 * MS, 0)

    def test_late_within_its_period_is_late_and_not_missed(self) -> None:
        schedule = self.begin(0, 19.999)
        assert (schedule.due_ns, schedule.missed) == (20 * MS, 0)

    def test_a_turn_whose_period_has_gone_by_is_missed_and_not_made_up_for(self) -> None:
        schedule = self.begin(0, 20)
        assert (schedule.due_ns, schedule.missed) == (30 * MS, 1)
        schedule = self.begin(0, 57)
        assert (schedule.due_ns, schedule.missed) == (60 * MS, 4)

    def test_a_clock_that_is_early_changes_nothing(self) -> None:
        schedule = self.begin(0, 9)
        assert (schedule.due_ns, schedule.missed) == (20 * MS, 0)

    @settings(max_examples=60, deadline=None)
    @given(st.lists(st.integers(0, 95 * MS), max_size=60), st.integers(1, 20 * MS))
    def test_whatever_a_loop_does_its_turns_stay_on_the_grid(self, spans_ns: list[int], period_ns: int) -> None:
        """Turns of any length: each begins in a period of its own, and turns and missed ones together are the time."""
        schedule, now_ns = Schedule(0, period_ns), 0
        begun = []
        for span_ns in spans_ns:
            schedule.begin(now_ns)
            begun.append(now_ns // period_ns)
            assert schedule.due_ns % period_ns == 0
            assert now_ns < schedule.due_ns <= now_ns + period_ns
            now_ns = max(now_ns + span_ns, schedule.due_ns)
        assert len(set(begun)) == len(begun)
        if begun:
            assert len(begun) + schedule.missed == begun[-1] + 1


def test_recent_rate_forgets_and_does_not_guess() -> None:
    rate = RecentRate()
    assert rate.rate_hz(0) == 0.0
    for k in range(100):
        rate.note(k * 20_000_000)
    assert rate.rate_hz(99 * 20_000_000) == pytest.approx(50.0)
    assert rate.rate_hz(10_000_000_000) == 0.0
