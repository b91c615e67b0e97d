"""Three solvers behind one interface: equal answers, every fault named, recovery clean."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from controller_loop import Loop

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.errors import MissingExtraError
from bridge.messages import SupportCommand
from controller.admittance import Admittance
from controller.mpc import daqp_solver, solvers
from controller.mpc.assembly import Assembly, Instant
from controller.mpc.plan import Failure, Plan
from controller.mpc.predictive_law import PredictiveLaw, fading
from controller.mpc.problem import Problem
from controller.mpc.solver import Outcome, Solver
from controller.walker import Walker

NAMES = ("daqp", "osqp", "piqp")
# The wall clock of a loaded test machine must decide nothing.
CONFIG = MpcConfig(time_limit_s=0.1, max_iterations=5000)
SCALE = np.array(WalkerConfig().acceleration_max)
WALKER = Walker(WalkerConfig())
ADMITTANCE = Admittance(AdmittanceConfig(), CONFIG.stage_s, fading(CONFIG))
LAW = PredictiveLaw(WALKER, ADMITTANCE, CONFIG, 0.01)
ASSEMBLY = Assembly(LAW.structure)
ROWS = LAW.structure.rows


def instant(
    wrench: Any = (0.0,) * 6, profile: float = 0.0, velocity: Any = (0.0,) * 4, previous: Any = (0.0,) * 4
) -> Instant:
    push = np.array(wrench, dtype=float)
    speed = np.array(velocity, dtype=float)
    ADMITTANCE.reset()
    pose = np.array([0.0, 0.0, 0.0, 1.0])
    law = ADMITTANCE.stages(np.full(CONFIG.stages, profile), pose, speed, push @ WALKER.terms.interface)
    return Instant(law, push, np.zeros(4), speed, np.array(previous, dtype=float), 1.0)


def posed(asked: Instant) -> Problem:
    """Return a problem with arrays of its own, as the first of a series."""
    return Problem(*(np.array(part) for part in ASSEMBLY.fill(asked)[:5]), matrices_changed=True)


ORDINARY = posed(instant([30.0, 20.0, -50.0, 0, 0, 2.0], velocity=[0.5, 0.1, 0.1, 0.0]))
HARD = posed(instant([150.0, 80.0, -300.0, 0, 0, 0], 1.0, [0.8, 0, 0, 0]))


def solver(name: str, **changes: Any) -> Solver:
    return solvers.create(LAW.structure, CONFIG.model_copy(update={"solver": name, **changes}))


def test_all_three_give_equal_answers() -> None:
    """Over ordinary and hard instants in one series, each solver keeping its own memory of it."""
    engines = {name: solver(name) for name in NAMES}
    random = np.random.default_rng(5)
    for _ in range(25):
        problem = posed(
            instant(
                random.normal(0, [80, 80, 300, 10, 10, 10]),
                float(random.choice([0.0, 0.3, 1.0])),
                np.array(WalkerConfig().velocity_max) * random.uniform(-0.45, 0.45, 4),
                SCALE * random.uniform(-0.5, 0.5, 4),
            )
        )
        plans = {}
        for name, engine in engines.items():
            outcome = engine.solve(problem)
            assert isinstance(outcome, Plan), (name, outcome)
            plans[name] = outcome
        for name in ("osqp", "piqp"):
            apart = (plans[name].acceleration[0] - plans["daqp"].acceleration[0]) / SCALE
            assert np.abs(apart).max() < 2e-3, name
        assert max(plans["daqp"].residuals) < 1e-9


def with_bounds(low: float, high: float, kind: str = "acceleration") -> Problem:
    lower, upper = ORDINARY.l.copy(), ORDINARY.u.copy()
    lower[ROWS[kind][0, 0]], upper[ROWS[kind][0, 0]] = low, high
    return ORDINARY._replace(l=lower, u=upper)


def with_nan(part: str) -> Problem:
    values = getattr(ORDINARY, part).copy()
    values[3] = np.nan
    return ORDINARY._replace(**{part: values})


def unbounded() -> Problem:
    """No cost but a slope, and no limit along it."""
    equation = ORDINARY.l == ORDINARY.u
    return ORDINARY._replace(
        P=np.zeros_like(ORDINARY.P),
        q=np.ones_like(ORDINARY.q),
        l=np.where(equation, ORDINARY.l, -np.inf),
        u=np.where(equation, ORDINARY.u, np.inf),
    )


# fault -> problem, changes of the configuration, what the reason must say
FAULTS: dict[str, tuple[Callable[[], Problem], dict[str, Any], str]] = {
    "infeasible": (lambda: with_bounds(5.0, 6.0), {}, "no feasible motion"),
    "unbounded": (unbounded, {}, "unbounded"),
    "crossed bounds": (lambda: ORDINARY._replace(l=ORDINARY.u + 1.0), {}, "exceeds its upper bound"),
    **{f"NaN in {part}": (lambda part=part: with_nan(part), {}, f"{part} of the problem") for part in ("P", "q", "A")},  # type: ignore[misc]
    **{f"NaN in {part}": (lambda part=part: with_nan(part), {}, "bound of the problem is not") for part in ("l", "u")},  # type: ignore[misc]
    "iteration limit": (lambda: HARD, {"max_iterations": 1}, "iteration limit"),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_a_failure_with_its_reason_and_recovery_is_clean(name: str, fault: str) -> None:
    make, changes, reason = FAULTS[fault]
    engine = solver(name, **changes)
    if not changes:
        assert isinstance(engine.solve(ORDINARY), Plan)
    failed = engine.solve(make())
    assert isinstance(failed, Failure)
    assert reason in failed.reason
    engine.config = CONFIG.model_copy(update={"solver": name})
    # What the assembly says has not changed since, the solver must take whole: its workspace is a stale one.
    again = engine.solve(ORDINARY._replace(matrices_changed=False))
    assert isinstance(again, Plan), again
    exact = solver("daqp").solve(ORDINARY)
    assert isinstance(exact, Plan)
    np.testing.assert_allclose(again.acceleration[0] / SCALE, exact.acceleration[0] / SCALE, atol=2e-3)


def test_osqp_stops_at_its_time_limit() -> None:
    failed = solver("osqp", time_limit_s=1e-6).solve(HARD)
    assert isinstance(failed, Failure)
    assert "time limit" in failed.reason


def test_daqp_stopped_by_its_time_limit_has_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """It looks at the clock every 32 iterations; no problem of ours lasts so long, so its word is put in its mouth."""

    class Late:
        def __init__(self) -> None:
            self.settings: dict[str, Any] = {}

        def setup(self, *_: Any) -> tuple[int, float]:
            return 1, 0.0

        def solve(self) -> Any:
            return np.zeros(80), 0.0, -7, {"solve_time": 1.0, "iterations": 32, "lam": np.zeros(393)}

    monkeypatch.setattr(daqp_solver.daqp, "Model", Late)
    failed = solver("daqp").solve(HARD)
    assert isinstance(failed, Failure)
    assert "time limit" in failed.reason


@pytest.mark.parametrize("name", NAMES)
def test_an_answer_that_is_not_one_is_caught_whatever_the_solver_says(name: str) -> None:
    engine = solver(name)
    honest = engine._answer

    def lying(fresh: bool, matrices_changed: bool) -> Outcome:
        outcome = honest(fresh, matrices_changed)
        engine.workspace.x[5] += 0.01
        return outcome

    engine._answer = lying  # type: ignore[method-assign]
    failed = engine.solve(ORDINARY)
    assert isinstance(failed, Failure)
    assert "off by" in failed.reason
    engine._answer = lambda *_: Outcome("solved", answered=True)  # type: ignore[method-assign]
    engine.workspace.x[:] = np.nan
    failed = engine.solve(ORDINARY)
    assert isinstance(failed, Failure)
    assert "not finite" in failed.reason


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("field", ["wrench", "draw", "velocity", "previous", "height_m"])
def test_nan_in_any_input_is_named_and_leaves_nothing_behind(field: str, place: int) -> None:
    asked = instant([30.0, 20.0, -50.0, 0, 0, 2.0])
    before = LAW.plan(asked)
    assert isinstance(before, Plan)
    value = np.array(getattr(asked, field), dtype=float)
    if place >= value.size:
        return
    value.flat[place] = np.nan
    failed = LAW.plan(asked._replace(**{field: float(value) if value.ndim == 0 else value}))
    assert isinstance(failed, Failure)
    assert field.removesuffix("_m") in failed.reason
    after = LAW.plan(asked)
    assert isinstance(after, Plan)
    np.testing.assert_allclose(after.acceleration, before.acceleration, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_loop_falls_back_with_the_reason_and_rejoins_without_a_jump(name: str) -> None:
    loop = Loop(mpc=CONFIG.model_copy(update={"solver": name}))
    wrench = [25.0, 10.0, -100.0, 0, 0, 1.0]
    commands = loop.run(0.3, wrench, 0.5)
    engine = loop.controller.predictive_law._solver
    honest = engine._answer
    engine._answer = lambda *_: Outcome("test", answered=False, reason="the problem is unbounded")  # type: ignore[method-assign]
    failing = loop.run(0.1, wrench, 0.5)
    engine._answer = honest  # type: ignore[method-assign]
    again = loop.run(0.2, wrench, 0.5)
    assert {command.solver for command in commands} == {command.solver for command in again} == {"mpc"}
    assert {command.solver for command in failing} == {"fallback"}
    assert all("the problem is unbounded" in command.reason for command in failing)
    assert_no_jump([*commands[-2:], *failing, *again])


def assert_no_jump(commands: list[SupportCommand]) -> None:
    steps = np.diff([command.acceleration for command in commands], axis=0)
    assert (np.abs(steps) <= 0.011 * np.array(WalkerConfig().jerk_max)).all()
    # The law's own step and the plan's first one are the same law: rejoining is no more than a ripple.
    assert np.abs(steps / SCALE).max() < 0.05


def test_what_a_hard_step_made_of_osqps_step_size_is_taken_back() -> None:
    engine: Any = solver("osqp")
    assert isinstance(engine.solve(posed(instant([0, 900.0, -100.0, 0, 0, 0]))), Plan)
    assert engine._solver.get_settings().rho != CONFIG.step_size
    assert isinstance(engine.solve(posed(instant([0, 20.0, -100.0, 0, 0, 0]))), Plan)
    assert engine._solver.get_settings().rho == CONFIG.step_size


def test_a_solver_that_is_not_installed_says_which_extra_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "piqp", None)
    monkeypatch.delitem(sys.modules, "controller.mpc.piqp_solver", raising=False)
    with pytest.raises(MissingExtraError, match=r"mpc.solver = 'piqp' needs the package 'piqp'.*surefoot\[solvers\]"):
        solver("piqp")
