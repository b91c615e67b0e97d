"""The problem, its numbers and its solution."""

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
from controller.mpc.plan import Failure, Plan
from controller.mpc.predictive_law import Instant, PredictiveLaw, fading
from controller.mpc.problem import Problem
from controller.mpc.solver import OsqpSolver
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
        self.law = PredictiveLaw(self.walker, self.admittance, self.machine, config, PERIOD_S)

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
        terms = self.walker.evaluate(height_m, velocity)
        self.machine.linearise(terms)
        push = np.asarray(wrench, dtype=float)
        bounds = self.machine.bounds(terms, push, self.fading)
        force = self.fading[:, None] * (push @ terms.interface)
        self.admittance.reset()
        pose = np.array([0.0, 0.0, 0.0, height_m])
        self.admittance.stages(stages, pose, velocity, force[0])
        law = self.admittance.stages(stages, pose + np.asarray(apart), velocity, force[0])
        give_way = self.machine.give_way(terms, push, bounds)
        return Instant(law, force, velocity, previous, height_m, bounds, give_way)

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


def test_numbers_filled_by_numpy_are_those_of_the_symbolic_problem(bench: Bench) -> None:
    random = np.random.default_rng(1)
    for _ in range(10):
        instant = random_instant(bench, random)
        problem = bench.law.problem(instant)
        structure = bench.law.structure
        law = instant.law
        parameters = (
            law.damping,
            law.stiffness,
            instant.force - law.load,
            instant.velocity,
            instant.previous,
            bench.machine.rows,
        )
        np.testing.assert_allclose(problem.P, np.array(structure.cost_values(*parameters)).ravel(), atol=1e-9)
        np.testing.assert_allclose(problem.q, np.array(structure.gradient(*parameters)).ravel(), atol=1e-9)
        np.testing.assert_allclose(problem.A, np.array(structure.constraint_values(*parameters)).ravel(), atol=1e-9)
        offset = np.array(structure.constraint_offset(*parameters)).ravel()
        for kind in ("velocity_dynamics", "displacement_dynamics"):
            rows = structure.rows[kind]
            np.testing.assert_allclose(problem.l[rows], -offset[rows], atol=1e-12)
            np.testing.assert_allclose(problem.u[rows], -offset[rows], atol=1e-12)
        middle = 0.5 * (problem.l + problem.u)[structure.rows["jerk"]]
        np.testing.assert_allclose(middle, -offset[structure.rows["jerk"]], atol=1e-12)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=15)
def test_the_problem_always_has_a_solution(seed: int) -> None:
    """Pushes of a kilonewton, speeds at their limits: linear programming finds a feasible motion every time."""
    bench = _SHARED
    random = np.random.default_rng(seed)
    problem = bench.law.problem(random_instant(bench, random, push=8.0))
    assert problem.flaw() == ""
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
    expected = (instant.force[0] - law.load[0] - (law.damping[0] + half * law.stiffness[0]) * instant.velocity) / (
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
    rows, walker = bench.machine.rows[TIP_ROWS], WalkerConfig()
    reach = np.array(walker.jerk_max) * (PERIOD_S + CONFIG.stage_s * np.arange(20))[:, None]
    most = np.minimum(reach, np.array(walker.acceleration_max)) * [1, 1, 1, 0]  # giving way leaves the column alone
    # While velocity does not yet bind: the sideward limit is reached after a third of a second at full acceleration.
    for k in range(10):
        excess = rows @ plan.acceleration[k] - instant.bounds.high[k, TIP_ROWS]
        least = linprog(
            [0, 0, 0, 0, 1.0],
            A_ub=np.hstack([rows, -np.ones((4, 1))]),
            b_ub=instant.bounds.high[k, TIP_ROWS],
            bounds=[*zip(-most[k], most[k], strict=True), (0, None)],
        )
        assert excess.max() <= least.fun + 0.03  # the opening that leaves the problem an interior


def solver(bench: Bench, **changes: Any) -> OsqpSolver:
    return OsqpSolver(bench.law.structure, CONFIG.model_copy(update=changes))


def test_each_fault_is_a_failure_with_its_reason_and_recovery_is_clean(bench: Bench) -> None:
    problem = bench.law.problem(bench.instant([30.0, 20.0, 0, 0, 0, 0]))
    problem = Problem(*(np.array(part) for part in problem[:5]), matrices_changed=True)
    engine = solver(bench)
    first = engine.solve(problem)
    assert isinstance(first, Plan)

    lower, upper = problem.l.copy(), problem.u.copy()
    rows = bench.law.structure.rows["acceleration"][0]
    lower[rows[0]], upper[rows[0]] = 5.0, 6.0  # accelerate far beyond the jerk limit
    infeasible = engine.solve(problem._replace(l=lower, u=upper))
    assert isinstance(infeasible, Failure)
    assert "no feasible motion" in infeasible.reason

    for name in ("P", "q", "A", "l", "u"):
        broken = getattr(problem, name).copy()
        broken[3] = np.nan
        failed = engine.solve(problem._replace(**{name: broken}))
        assert isinstance(failed, Failure)
        assert "not" in failed.reason

    crossed = engine.solve(problem._replace(l=problem.u + 1.0))
    assert isinstance(crossed, Failure)
    assert "exceeds" in crossed.reason

    again = engine.solve(problem)
    assert isinstance(again, Plan)
    np.testing.assert_allclose(again.acceleration, first.acceleration, atol=5e-3)


def test_iteration_and_time_limits_are_failures_unless_the_answer_is_good(bench: Bench) -> None:
    problem = bench.law.problem(bench.instant([150.0, 80.0, -300.0, 0, 0, 0], 1.0, [0.8, 0, 0, 0]))
    problem = Problem(*(np.array(part) for part in problem[:5]), matrices_changed=True)
    few = solver(bench, max_iterations=5).solve(problem)
    assert isinstance(few, Failure)
    assert "iteration limit" in few.reason
    assert few.residuals is not None
    late = solver(bench, time_limit_s=1e-6).solve(problem)
    assert isinstance(late, Failure)
    assert "time limit" in late.reason


def test_an_unbounded_problem_is_a_failure(bench: Bench) -> None:
    problem = bench.law.problem(bench.instant())
    away = problem._replace(
        P=np.zeros_like(problem.P),
        q=np.ones_like(problem.q),
        l=np.where(problem.l == problem.u, problem.l, -np.inf),
        u=np.where(problem.l == problem.u, problem.u, np.inf),
        matrices_changed=True,
    )
    failed = solver(bench).solve(away)
    assert isinstance(failed, Failure)


def test_an_answer_that_is_not_optimal_is_caught_whatever_the_solver_says(bench: Bench) -> None:
    """With a coarse tolerance the solver is content long before our own residuals are."""
    problem = bench.law.problem(bench.instant([150.0, 80.0, -300.0, 0, 0, 0], 1.0, [0.8, 0, 0, 0]))
    failed = solver(bench, accuracy=1e-2).solve(problem._replace(matrices_changed=True))
    assert isinstance(failed, Failure)
    assert "off by" in failed.reason


def test_what_a_hard_step_made_of_the_step_size_is_taken_back(bench: Bench) -> None:
    def problem(sideward_n: float) -> Problem:
        filled = bench.law.problem(bench.instant([0, sideward_n, -100.0, 0, 0, 0]))
        return Problem(*(np.array(part) for part in filled[:5]), matrices_changed=True)

    engine = solver(bench)
    assert isinstance(engine.solve(problem(900.0)), Plan)
    assert engine._solver.get_settings().rho != CONFIG.step_size
    assert isinstance(engine.solve(problem(20.0)), Plan)
    assert engine._solver.get_settings().rho == CONFIG.step_size
