"""How regularly a loop turns."""

from __future__ import annotations

import pytest

from bridge.timing import LoopTiming, RecentRate

MS = 1_000_000


def test_before_the_second_turn() -> None:
    timing = LoopTiming(0.01)
    assert (timing.rate_hz(), timing.period_p99_s(), timing.missed) == (0.0, 0.0, 0)
    timing.tick(5)
    assert (timing.rate_hz(), timing.period_p99_s(), timing.missed) == (0.0, 0.0, 0)


def test_rate_percentile_and_misses() -> None:
    timing = LoopTiming(0.01)
    now_ns = 0
    for k in range(201):
        timing.tick(now_ns)
        now_ns += (16 if k % 50 == 49 else 10) * MS
    assert timing.missed == 4
    assert timing.rate_hz() == pytest.approx(200 / (200 * 0.01 + 4 * 0.006))
    assert timing.period_p99_s() == pytest.approx(0.016, abs=0.001)


def test_one_and_a_half_periods_is_not_missed() -> None:
    timing = LoopTiming(0.01)
    for now_ns in (0, 15 * MS, 30 * MS + 1):
        timing.tick(now_ns)
    assert timing.missed == 1


def test_old_turns_are_forgotten() -> None:
    timing = LoopTiming(0.01, length=10)
    now_ns = 0
    for period_ms in [50] * 20 + [10] * 11:
        now_ns += period_ms * MS
        timing.tick(now_ns)
    assert timing.rate_hz() == pytest.approx(100.0)
    assert timing.period_p99_s() == pytest.approx(0.01)


def test_recent_rate_forgets_and_does_not_guess() -> None:
    rate = RecentRate()
    assert rate.rate_hz(0) == 0.0
    for k in range(100):
        rate.note(k * 20_000_000)
    assert rate.rate_hz(99 * 20_000_000) == pytest.approx(50.0)
    assert rate.rate_hz(10_000_000_000) == 0.0
