"""What holds without a plan: limiter, clamped law, controlled stop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.walker import WalkerConfig
from controller.fallback import stop_acceleration, within_machine
from controller.machine_limits import MachineLimits
from controller.motion_limits import MotionLimits
from controller.walker import Walker

CONFIG = WalkerConfig()
LIMITS = MotionLimits(CONFIG)
WALKER = Walker(CONFIG)
MACHINE = MachineLimits(WALKER)


def wheel_speeds(velocity: np.ndarray) -> np.ndarray:
    return WALKER.wheel_jacobian @ velocity[:3]


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_limiter_keeps_every_limit_for_any_wish_and_any_period(seed: int) -> None:
    random = np.random.default_rng(seed)
    velocity = LIMITS.viable_velocity(random.normal(0, 1.0, 4))
    acceleration, height = np.zeros(4), float(random.uniform(CONFIG.column_low_m + 0.1, CONFIG.column_high_m - 0.1))
    wish = np.zeros(4)
    for _ in range(150):
        if random.random() < 0.15:
            wish = random.choice([random.normal(0, 3, 4), 1e6 * random.normal(0, 1, 4)])
        span_s = float(random.choice([0.01, 0.01, 0.002, 0.02]))
        got = LIMITS.clamp(wish, velocity, acceleration, height, span_s)
        assert (np.abs(got) <= LIMITS.acceleration + 1e-12).all()
        assert (np.abs(got - acceleration) <= LIMITS.jerk * span_s + 1e-9).all()
        height += span_s * (velocity[3] + 0.5 * span_s * got[3])
        velocity = velocity + span_s * got
        acceleration = got
        assert (np.abs(velocity) <= LIMITS.velocity + 1e-9).all()
        assert np.abs(wheel_speeds(velocity)).max() <= CONFIG.wheel_speed_max_rad_s + 1e-6
        assert CONFIG.column_low_m - 1e-4 <= height <= CONFIG.column_high_m + 1e-4


def test_limiter_leaves_alone_what_is_within_limits() -> None:
    wish = np.array([0.3, -0.2, 0.5, 0.4])
    np.testing.assert_allclose(LIMITS.clamp(wish, np.full(4, 0.1), wish, 1.0, 0.01), wish)


@pytest.mark.parametrize("velocity", [[1.2, 0, 0, 0], [0.3, -0.6, 0.2, 0.3], [-0.5, 0.5, -0.3, -0.4]])
def test_controlled_stop_comes_to_rest_at_the_limits_and_stays(velocity: list[float]) -> None:
    v, a = LIMITS.viable_velocity(np.array(velocity)), np.zeros(4)
    start = np.abs(v)
    steps = 0
    while not ((np.abs(v) < 1e-4).all() and (np.abs(a) < 1e-2).all()):
        a = LIMITS.clamp(stop_acceleration(v, LIMITS, 0.01), v, a, 1.0, 0.01)
        v = v + 0.01 * a
        steps += 1
        assert steps < 150
    slowest = np.max(start / LIMITS.acceleration + LIMITS.acceleration / LIMITS.jerk)
    assert 0.01 * steps <= slowest + 0.1
    np.testing.assert_allclose(v, 0.0, atol=1e-4)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_clamped_law_stays_within_the_machine_or_as_near_as_giving_way(seed: int) -> None:
    random = np.random.default_rng(seed)
    wrench = random.normal(0, [150, 150, 600, 20, 20, 20])
    terms = WALKER.evaluate(float(random.uniform(0.7, 1.2)), random.normal(0, 0.3, 4))
    MACHINE.linearise(terms)
    bounds = MACHINE.bounds(terms, wrench, np.ones(1))
    way = MACHINE.give_way(terms, wrench, bounds)
    got = within_machine(random.normal(0, 4, 4), way, MACHINE.rows, bounds)
    at_way, at_got = MACHINE.rows @ way, MACHINE.rows @ got
    assert (at_got <= np.maximum(bounds.high[0], at_way) + 1e-7).all()
    assert (at_got >= np.minimum(bounds.low[0], at_way) - 1e-7).all()
    assert (got >= bounds.box_low[0] - 1e-9).all()
    assert (got <= bounds.box_high[0] + 1e-9).all()


def test_clamped_law_follows_the_wish_where_the_machine_can() -> None:
    terms = WALKER.evaluate(1.0, np.zeros(4))
    MACHINE.linearise(terms)
    bounds = MACHINE.bounds(terms, np.zeros(6), np.ones(1))
    wish = np.array([1.0, -0.5, 0.7, 0.5])
    np.testing.assert_allclose(within_machine(wish, np.zeros(4), MACHINE.rows, bounds), wish)
