"""Whatever comes in, the command is finite, inside every limit and rate, and keeps upright where that can be.

Every example is a quarter to half a second of steps. `make properties` runs a hundred times as many and says how many.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from controller_loop import MPC, NS, PERIOD_S, Loop, decision
from hypothesis import event, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from controller.admittance_controller import AdmittanceController
from controller.balance import TipLimits, no_limits, upright
from controller.machine_limits import TIP_ROWS, MachineLimits
from controller.motion_limits import MotionLimits
from controller.walker import Walker

WALKER = WalkerConfig()
LIMITS = MotionLimits(WALKER)
SHARED = AdmittanceController(WALKER, AdmittanceConfig(), MpcConfig(time_limit_s=0.1))
TIMES = int(os.environ.get("SUREFOOT_EXAMPLES", "1"))  # how many times the usual number of examples
WHEELS = Walker(WALKER)

anything = st.one_of(st.floats(-300, 300), st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -4999.0, 4999.0, 0.0]))


def assert_within_limits(command: SupportCommand, before: SupportCommand | None, span_s: float) -> None:
    assert np.isfinite(command.velocity).all()
    assert np.isfinite(command.acceleration).all()
    assert (np.abs(command.velocity) <= LIMITS.velocity + 1e-9).all()
    assert (np.abs(command.acceleration) <= LIMITS.acceleration + 1e-9).all()
    last = np.zeros(4) if before is None else before.acceleration
    assert (np.abs(command.acceleration - last) <= LIMITS.jerk * span_s + 1e-9).all()
    if before is not None:
        np.testing.assert_allclose(command.velocity, before.velocity + span_s * command.acceleration, atol=1e-9)
    assert np.abs(WHEELS.wheel_jacobian @ command.velocity[:3]).max() <= WALKER.wheel_speed_max_rad_s + 1e-6
    assert WALKER.column_low_m - 1e-4 <= command.column_height <= WALKER.column_high_m + 1e-4


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.tuples(st.integers(0, 11), anything), max_size=6),
    st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=25),
)
@settings(deadline=None, max_examples=20 * TIMES)
def test_anything_in_gives_a_finite_command_inside_all_limits_out(
    seed: int, nonsense: list[tuple[int, float]], profile: list[float]
) -> None:
    """Random motions, pushes, profiles, states and periods, with numbers in any place that no sensor should send."""
    random = np.random.default_rng(seed)
    controller = SHARED
    controller.reset()
    now_ns, before, started = NS, None, False
    for k in range(25):
        numbers = random.normal(0, [60, 60, 400, 15, 15, 15, 0.3, 0.3, 0.1, 0.3, 2.0, 0.3])
        if random.random() < 0.5:
            for place, value in nonsense:
                numbers[place] = value
        numbers[8] += 1.0  # around mid-stroke
        span_s = PERIOD_S if k == 0 else float(random.choice([0.01, 0.01, 0.01, 0.0, 0.001, 0.02]))
        now_ns += round(span_s * NS)
        odometry = Odometry(
            stamp_ns=now_ns,
            position=np.array([*numbers[6:8], numbers[8]]),
            yaw=numbers[10],
            velocity=np.array([numbers[9], 0.1 * numbers[9], 0.3 * numbers[11]]),
            yaw_rate=numbers[11],
        )
        wrench = Wrench(stamp_ns=now_ns, force=numbers[:3], torque=numbers[3:6])
        values = np.array(profile) if random.random() < 0.3 else np.full(20, random.random())
        state = GaitState(random.choice(np.array(list(GaitState))))
        asked = decision(0.0)._replace(profile=values, state=state)
        command = controller.step(now_ns, odometry, wrench, asked)
        command.check()
        # the first motion is whatever was measured, made viable: what came before it is not the controller's
        assert_within_limits(command, before if started else None, span_s)
        before, started = command, command.valid
        event(command.solver)


def best_in_reach(rows: np.ndarray, high: np.ndarray, last: np.ndarray, given_: np.ndarray) -> float:
    """Return the least excess over the tip-over limits that the base could have in this step, the rest as given."""
    low_x = np.maximum(last - LIMITS.jerk * PERIOD_S, -LIMITS.acceleration)
    high_x = np.minimum(last + LIMITS.jerk * PERIOD_S, LIMITS.acceleration)
    low_x[2:] = high_x[2:] = given_[2:]
    bounds = [*zip(low_x, high_x, strict=True), (None, None)]
    answer = linprog([0, 0, 0, 0, 1], A_ub=np.hstack([rows, -np.ones((4, 1))]), b_ub=high, bounds=bounds)
    return float(answer.x[4])


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 1.0, 2.0]))
@settings(deadline=None, max_examples=12 * TIMES)
def test_tip_over_margin_is_respected_whenever_it_can_be(seed: int, harsh: float) -> None:
    """Against a linear program: where any acceleration of the base in reach keeps the margin, so does the command.

    Near a speed limit the reach is cut by it, which the linear program does not know: there nothing is claimed.
    """
    random = np.random.default_rng(seed)
    loop = SHARED_LOOP
    loop.controller.reset()
    loop.pose, loop.velocity = np.array([0.0, 0.0, 0.0, random.uniform(0.8, 1.1)]), np.zeros(4)
    wrench, s = np.zeros(6), 0.0
    for k in range(50):
        if random.random() < 0.1:
            wrench = harsh * random.normal(0, [90, 60, 300, 10, 10, 10])
        if random.random() < 0.1:
            s = float(random.choice([0.0, random.random(), 1.0]))
        motion = loop.controller._motion
        velocity, last, height = motion.velocity.copy(), motion.acceleration.copy(), float(motion.pose[3])
        command = loop.step(wrench, s)
        if k == 0:
            continue
        terms = WHEELS.evaluate(height, velocity)
        STATED.linearise(terms)
        rows = STATED.rows[TIP_ROWS]
        high = STATED.bounds(terms, wrench, np.ones(1)).high[0, TIP_ROWS]
        excess = float((rows @ command.acceleration - high).max())
        if excess > 1e-6:
            event("outside the margin")
            at_speed_limit = (np.abs(command.velocity[:2]) > 0.9 * LIMITS.velocity[:2]).any()
            assert at_speed_limit or best_in_reach(rows, high, last, command.acceleration) > 0.0


SHARED_LOOP = Loop(mpc=MPC)
STATED = MachineLimits(WHEELS, spare=0.0)


def test_balance_is_left_alone_where_it_is_kept() -> None:
    terms = WHEELS.evaluate(1.0, np.zeros(4))
    STATED.linearise(terms)
    calm = TipLimits(STATED.rows[TIP_ROWS], STATED.bounds(terms, np.zeros(6), np.ones(1)).high[0, TIP_ROWS])
    wish = np.array([0.5, -0.3, 0.2, 0.1])
    np.testing.assert_array_equal(upright(wish, calm, lambda a: a), wish)
    np.testing.assert_array_equal(upright(wish, no_limits(), lambda a: a), wish)


@pytest.mark.parametrize("push", [[0, 300, -100, 0, 0, 0], [0, -300, 0, 0, 0, 0], [400, 0, 100, 0, 0, 0]])
def test_a_push_that_would_tip_the_walker_is_moved_under(push: list[float]) -> None:
    terms = WHEELS.evaluate(1.0, np.zeros(4))
    STATED.linearise(terms)
    limits = TipLimits(STATED.rows[TIP_ROWS], STATED.bounds(terms, np.array(push, float), np.ones(1)).high[0, TIP_ROWS])
    assert limits.excess(np.zeros(4)) > 0.0
    moved = upright(np.zeros(4), limits, lambda a: a)
    assert limits.excess(moved) <= 1e-9
    assert moved[:2] @ np.array(push)[:2] > 0.0
    # out of reach: as far as it goes, and never worse than before
    held = upright(np.zeros(4), limits, lambda a: np.clip(a, -0.1, 0.1))
    assert np.abs(held).max() <= 0.1
    assert limits.excess(held) < limits.excess(np.zeros(4))
