"""The problem and what its solution is worth."""

from __future__ import annotations

from typing import Any

import numpy as np
import osqp
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import linprog

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from controller.admittance import Admittance
from controller.machine_limits import TIP_ROWS, MachineLimits
from controller.mpc.assembly import Instant
from controller.mpc.plan import Plan
from controller.mpc.predictive_law import PredictiveLaw, fading
from controller.mpc.problem import Problem
from controller.walker import Walker

PERIOD_S = 0.01
CONFIG = MpcConfig(time_limit_s=0.1, max_iterations=5000)
MIRROR = np.array([1.0, -1.0, -1.0, 1.0])


class Bench:
    """A predictive law with the parts it needs, asked about single instants."""

    def __init__(self, config: MpcConfig = CONFIG) -> None:
        self.config = config
        self.walker = Walker(WalkerConfig())
        self.fading = fading(config)
        self.machine = MachineLimits(self.walker)
        self.admittance = Admittance(AdmittanceConfig(), config.stage_s, self.fading)
        self.law = PredictiveLaw(self.walker, self.admittance, config, PERIOD_S)

    def instant(
        self,
        wrench: Any = (0.0,) * 6,
        profile: Any = 0.0,
        velocity: Any = (0.0,) * 4,
        previous: Any = (0.0,) * 4,
        height_m: float = 1.0,
        apart: Any = (0.0,) * 4,
    ) -> Instant:
        velocity, previous = np.asarray(velocity, dtype=float), np.asarray(previous, dtype=float)
        stages = np.broadcast_to(np.asarray(profile, dtype=float), (self.config.stages,)).copy()
        push = np.asarray(wrench, dtype=float)
        force = push @ self.walker.terms.interface
        self.admittance.reset()
        pose = np.array([0.0, 0.0, 0.0, height_m])
        self.admittance.stages(stages, pose, velocity, force)
        law = self.admittance.stages(stages, pose + np.asarray(apart), velocity, force)
        return Instant(law, push, np.zeros(4), velocity, previous, height_m)

    def limits(self, instant: Instant) -> tuple[Any, Any]:
        """Return bounds and giving way as NumPy and Pinocchio count them, with the rows set for the instant."""
        terms = self.walker.evaluate(instant.height_m, instant.velocity)
        self.machine.linearise(terms)
        bounds = self.machine.bounds(terms, instant.wrench, self.fading)
        return bounds, self.machine.give_way(terms, instant.wrench, bounds)

    def plan(self, instant: Instant) -> Plan:
        plan = self.law.plan(instant)
        assert isinstance(plan, Plan), plan
        return plan


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


def random_instant(bench: Bench, random: np.random.Generator, push: float = 1.0) -> Instant:
    limits = np.array(WalkerConfig().velocity_max)
    profile = random.choice([np.zeros(20), np.clip(np.linspace(random.normal(), random.normal(), 20), 0, 1)])
    return bench.instant(
        wrench=push * random.normal(0, [60, 60, 300, 10, 10, 10]),
        profile=profile,
        velocity=limits * random.uniform(-0.45, 0.45, 4),
        previous=np.array(WalkerConfig().acceleration_max) * random.uniform(-0.5, 0.5, 4),
        height_m=float(random.uniform(0.85, 1.1)),
        apart=random.normal(0, [0.03, 0.03, 0.05, 0.01]),
    )


def matrices(bench: Bench, problem: Problem) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    cost, constraints = bench.law.structure.cost, bench.law.structure.constraints
    upper = sparse.csc_matrix((problem.P, cost.indices, cost.indptr), cost.shape)
    A = sparse.csc_matrix((problem.A, constraints.indices, constraints.indptr), constraints.shape)
    return upper, A


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=15)
def test_the_problem_always_has_a_solution(seed: int) -> None:
    """Pushes of a kilonewton, speeds at their limits: linear programming finds a feasible motion every time."""
    bench = _SHARED
    random = np.random.default_rng(seed)
    problem = bench.law.problem(random_instant(bench, random, push=8.0))
    _, A = matrices(bench, problem)
    rows = sparse.vstack([A, -A])
    bounds = np.concatenate([problem.u, -problem.l])
    finite = np.isfinite(bounds)
    result = linprog(np.zeros(A.shape[1]), A_ub=rows.tocsr()[finite], b_ub=bounds[finite] + 1e-9, bounds=(None, None))
    assert result.status == 0, result.message


_SHARED = Bench()


def test_first_input_agrees_with_a_tight_reference(bench: Bench) -> None:
    """Within 1e-3 of the acceleration limit, over ordinary instants and hard ones."""
    random = np.random.default_rng(3)
    scale = np.array(WalkerConfig().acceleration_max)
    for _ in range(15):
        instant = random_instant(bench, random)
        plan = bench.plan(instant)
        problem = bench.law.problem(instant)
        upper, A = matrices(bench, problem)
        reference = osqp.OSQP()
        reference.setup(
            upper, problem.q, A, problem.l, problem.u, verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=200_000
        )
        exact = reference.solve(raise_error=False)
        assert exact.info.status_val == 1
        np.testing.assert_allclose(plan.acceleration[0] / scale, exact.x[:4], atol=2e-3)


def test_plan_obeys_dynamics_and_limits(bench: Bench) -> None:
    random = np.random.default_rng(4)
    walker, dt = WalkerConfig(), CONFIG.stage_s
    for _ in range(10):
        instant = random_instant(bench, random)
        plan = bench.plan(instant)
        before = np.concatenate([instant.velocity[None], plan.velocity[:-1]])
        np.testing.assert_allclose(plan.velocity, before + dt * plan.acceleration, atol=1e-3)
        steps = np.diff(np.concatenate([instant.previous[None], plan.acceleration]), axis=0)
        spans = np.full((20, 1), dt)
        spans[0] = PERIOD_S
        assert (np.abs(plan.acceleration) <= 1.001 * np.array(walker.acceleration_max)).all()
        assert (np.abs(steps) <= 1.001 * np.array(walker.jerk_max) * spans + 1e-3).all()


def test_unconstrained_plan_is_the_admittance_itself(bench: Bench) -> None:
    instant = bench.instant(wrench=[8.0, -5.0, -20.0, 0, 0, 0.8], velocity=[0.2, 0.05, -0.1, 0.01])
    # Rolled through the increments' small weight, the plan approaches the law's own answer within a percent.
    law = instant.law
    half = 0.5 * PERIOD_S
    force = instant.wrench @ bench.walker.terms.interface
    expected = (force - law.load[0] - (law.damping[0] + half * law.stiffness[0]) * instant.velocity) / (
        law.mass + half * law.damping[0] + half**2 * law.stiffness[0]
    )
    settled = bench.plan(instant._replace(previous=expected))
    np.testing.assert_allclose(settled.acceleration[0], expected, rtol=0.01, atol=2e-3)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=10)
def test_left_and_right_are_mirror_images(seed: int) -> None:
    bench = _SHARED
    random = np.random.default_rng(seed)
    wrench = random.normal(0, [60, 60, 300, 10, 10, 10])
    velocity, apart = random.normal(0, [0.3, 0.15, 0.3, 0.05]), random.normal(0, [0.03, 0.03, 0.05, 0.0])
    profile = np.clip(np.linspace(0.2, random.uniform(0, 1), 20), 0, 1)
    one = bench.plan(bench.instant(wrench, profile, velocity, np.zeros(4), 1.0, apart))
    other = bench.plan(
        bench.instant(wrench * [1, -1, 1, -1, 1, -1], profile, velocity * MIRROR, np.zeros(4), 1.0, apart * MIRROR)
    )
    # Each within the solver's accuracy of its own optimum.
    scale = np.array(WalkerConfig().acceleration_max)
    np.testing.assert_allclose(one.acceleration[0] / scale, other.acceleration[0] * MIRROR / scale, atol=4e-3)


@pytest.mark.parametrize("onset", [2, 6, 12, 16])
def test_a_foreseen_stiffening_is_never_softer_now(bench: Bench, onset: int) -> None:
    """A person walking and pushing on: with a stiff phase ahead the walker speeds up less, or brakes."""
    later = np.where(np.arange(20) >= onset, 1.0, 0.0)
    for velocity, push in ((0.8, 30.0), (0.5, 60.0), (-0.7, -30.0), (0.1, 5.0)):
        wrench, v = [push, 0, 0, 0, 0, 0], [velocity, 0, 0, 0]
        free = bench.plan(bench.instant(wrench, 0.0, v)).acceleration[0, 0]
        warned = bench.plan(bench.instant(wrench, later, v)).acceleration[0, 0]
        assert np.sign(push) * (warned - free) <= 2e-3


def test_a_fall_foreseen_in_300_ms_brakes_a_fast_walker_now(bench: Bench) -> None:
    """At 1 m/s the braking limit does not stop the walker within the stiff phase: it must begin before."""
    later = np.where(np.arange(20) >= 12, 1.0, 0.0)
    wrench, v = [30.0, 0, 0, 0, 0, 0], [1.0, 0, 0, 0]
    free = bench.plan(bench.instant(wrench, 0.0, v))
    warned = bench.plan(bench.instant(wrench, later, v))
    assert warned.acceleration[0, 0] < free.acceleration[0, 0] - 0.1
    assert warned.velocity[12, 0] < free.velocity[12, 0] - 0.2


def test_earlier_stiffening_never_yields_a_faster_plan(bench: Bench) -> None:
    wrench, v = [60.0, 0, 0, 0, 0, 0], [0.8, 0, 0, 0]
    speeds = [
        bench.plan(bench.instant(wrench, np.where(np.arange(20) >= onset, 1.0, 0.0), v)).velocity[-1, 0]
        for onset in (3, 7, 11, 15, 19)
    ]
    assert (np.diff(speeds) >= -2e-3).all()


@pytest.mark.parametrize("push", [150.0, 260.0, 400.0, 900.0])
def test_tip_over_is_no_worse_than_the_best_motion_in_reach(bench: Bench, push: float) -> None:
    """The least violation, by linear programming over accelerations within limits and jerk, stage by stage."""
    instant = bench.instant([0, push, -100.0, 0, 0, 0])
    plan = bench.plan(instant)
    bounds, _ = bench.limits(instant)
    rows, walker = bench.machine.rows[TIP_ROWS], WalkerConfig()
    reach = np.array(walker.jerk_max) * (PERIOD_S + CONFIG.stage_s * np.arange(20))[:, None]
    most = np.minimum(reach, np.array(walker.acceleration_max)) * [1, 1, 1, 0]  # giving way leaves the column alone
    # While velocity does not yet bind: the sideward limit is reached after a third of a second at full acceleration.
    for k in range(10):
        excess = rows @ plan.acceleration[k] - bounds.high[k, TIP_ROWS]
        least = linprog(
            [0, 0, 0, 0, 1.0],
            A_ub=np.hstack([rows, -np.ones((4, 1))]),
            b_ub=bounds.high[k, TIP_ROWS],
            bounds=[*zip(-most[k], most[k], strict=True), (0, None)],
        )
        assert excess.max() <= least.fun + 0.03  # the opening that leaves the problem an interior
