"""OSQP behind a small interface: set up once, updated in place, never believed without a check."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import osqp
from scipy import sparse

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats
from controller.mpc.plan import Failure, Plan, Residuals
from controller.mpc.problem import Problem
from controller.mpc.structure import Structure

_SOLVED = 1
# Statuses that come with an answer. Whether it is a plan is decided by our own residuals.
_ANSWERED = {
    _SOLVED: "the solver is done",
    2: "the solver stopped short of its accuracy",
    7: "the solver reached its iteration limit",
    8: "the solver reached its time limit",
}
_REASONS = {
    3: "the problem has no feasible motion",
    4: "the problem has no feasible motion",
    5: "the problem is unbounded",
    6: "the problem is unbounded",
}


class Solver(Protocol):
    """Solves problems of one structure."""

    def solve(self, problem: Problem) -> Plan | Failure:
        """Return an accepted plan, or why there is none."""
        ...


class OsqpSolver:
    """OSQP (Stellato et al. 2020) with its workspace and warm start kept between steps."""

    def __init__(self, structure: Structure, config: MpcConfig) -> None:
        self._structure = structure
        self._config = config
        self._residuals = ResidualCheck(structure)
        self._stale = True

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._stale = True

    def solve(self, problem: Problem) -> Plan | Failure:
        """Return an accepted plan, or why there is none."""
        flaw = problem.flaw()
        if flaw:
            self._stale = True
            return Failure(flaw, status="")
        if self._stale:
            self._setup(problem)
        elif problem.matrices_changed:
            self._solver.update(q=problem.q, l=problem.l, u=problem.u, Px=problem.P, Ax=problem.A)
        else:
            self._solver.update(q=problem.q, l=problem.l, u=problem.u)
        result = self._solver.solve(raise_error=False)
        info = result.info
        status = int(info.status_val)
        spent = float(info.run_time)
        iterations = int(info.iter)

        def failure(reason: str, residuals: Residuals | None = None) -> Failure:
            return Failure(reason, str(info.status), iterations, residuals, spent)

        if status not in _ANSWERED:
            # The iterates are rays or worse: a warm start from them would poison every later solve.
            self._stale = True
            return failure(_REASONS.get(status, "the solver failed"))
        x, y = np.asarray(result.x), np.asarray(result.y)
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            self._stale = True
            return failure("the solver's answer is not finite")
        residuals = self._residuals(problem, x, y)
        worst, limit = max(residuals), self._config.residual_max
        if worst > limit:
            # Said to be solved and is not: something is wrong with the workspace.
            self._stale = status == _SOLVED
            off = f"the answer is off by {worst:.1e}, limit {limit:.1e}"
            return failure(f"{_ANSWERED[status]}, {off}" if status != _SOLVED else off, residuals)
        return decode(self._structure, x, residuals, iterations, spent)

    def _setup(self, problem: Problem) -> None:
        config, structure = self._config, self._structure
        self._solver: Any = osqp.OSQP()
        self._solver.setup(
            sparse.csc_matrix((problem.P, structure.cost.indices, structure.cost.indptr), structure.cost.shape),
            problem.q,
            sparse.csc_matrix(
                (problem.A, structure.constraints.indices, structure.constraints.indptr), structure.constraints.shape
            ),
            problem.l,
            problem.u,
            verbose=False,
            eps_abs=config.accuracy,
            eps_rel=config.accuracy,
            max_iter=config.max_iterations,
            time_limit=config.time_limit_s,
            check_termination=5,
            # The problem comes scaled, with rows weighted for the solver; its own scaling undoes that and
            # costs a pass over the matrices in every update. The step size adapts only after 50 iterations,
            # which ordinary steps never reach.
            scaling=0,
            rho=config.step_size,
            adaptive_rho=1,
            warm_starting=True,
        )
        self._stale = False


class ResidualCheck:
    """Optimality of an answer, counted without the solver: feasibility, stationarity, no gap to the dual cost."""

    def __init__(self, structure: Structure) -> None:
        cost, constraints = structure.cost, structure.constraints
        upper = sparse.csc_matrix((np.arange(1.0, len(cost.indices) + 1), cost.indices, cost.indptr), cost.shape)
        full = sparse.csc_matrix(upper + sparse.triu(upper, 1).T)
        full.sort_indices()
        self._cost_map = full.data.astype(np.int64) - 1
        self._P = sparse.csc_matrix((np.zeros(full.nnz), full.indices, full.indptr), cost.shape)
        self._A = sparse.csc_matrix(
            (np.zeros(len(constraints.indices)), constraints.indices, constraints.indptr), constraints.shape
        )
        self._fresh = False

    def __call__(self, problem: Problem, x: Floats, y: Floats) -> Residuals:
        """Return the residuals of primal `x` (n,) and multipliers `y` (m,)."""
        if problem.matrices_changed or not self._fresh:
            self._P.data[:] = problem.P[self._cost_map]
            self._A.data[:] = problem.A
            self._fresh = True
        value: Floats = np.asarray(self._A @ x)
        Px: Floats = np.asarray(self._P @ x)
        primal = max(float(np.max(problem.l - value)), float(np.max(value - problem.u)), 0.0)
        pull: Floats = np.asarray(self._A.T @ y)
        size = 1.0 + max(float(np.max(np.abs(part))) for part in (Px, problem.q, pull))
        dual = float(np.max(np.abs(Px + problem.q + pull))) / size
        # The dual cost takes each multiplier at the bound its sign pushes against; at an open bound it must vanish.
        bound = np.where(y > 0.0, problem.u, problem.l)
        open_bound = np.isinf(bound)
        stray = float(np.max(np.abs(y[open_bound]))) if open_bound.any() else 0.0
        support = float(y[~open_bound] @ bound[~open_bound])
        quadratic, linear = float(x @ Px), float(problem.q @ x)
        gap = abs(quadratic + linear + support) / (1.0 + max(abs(quadratic), abs(linear), abs(support)))
        return Residuals(primal, max(dual, stray / size), gap)


def decode(structure: Structure, x: Floats, residuals: Residuals, iterations: int, solve_time_s: float) -> Plan:
    """Return the plan that a decision vector `x` stands for."""
    setting = structure.setting
    stages = x.reshape(setting.stages, 12)
    return Plan(
        acceleration=stages[:, 0:4] * setting.acceleration,
        velocity=stages[:, 4:8] * setting.velocity,
        displacement=stages[:, 8:12] * setting.displacement,
        residuals=residuals,
        iterations=iterations,
        solve_time_s=solve_time_s,
    )
