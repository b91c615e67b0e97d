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
_NO_PUSH = 1e-9  # a multiplier this small pushes against nothing


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
        setting = structure.setting
        scale = np.concatenate([setting.acceleration, setting.velocity, setting.displacement])
        self._scale: Floats = np.tile(scale, (setting.stages, 1))
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
        return Plan(x.reshape(self._scale.shape) * self._scale, residuals, iterations, spent)

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
            check_termination=10,
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
        self._n = cost.shape[0]
        # One product with [P A'; A 0] gives the Lagrangian's gradient and the constraints' values. Its non-zeros
        # are numbered to find where those of P and A go.
        count = len(cost.indices)
        upper = sparse.csc_matrix((np.arange(1.0, count + 1), cost.indices, cost.indptr), cost.shape)
        numbers = np.arange(count + 1.0, count + len(constraints.indices) + 1)
        A = sparse.csc_matrix((numbers, constraints.indices, constraints.indptr), constraints.shape)
        P = upper + sparse.triu(upper, 1).T
        self._matrix = sparse.csr_matrix(sparse.vstack([sparse.hstack([P, A.T]), sparse.hstack([A, 0.0 * A @ A.T])]))
        self._matrix.eliminate_zeros()
        self._sources = self._matrix.data.astype(np.int64) - 1
        self._fresh = False

    def __call__(self, problem: Problem, x: Floats, y: Floats) -> Residuals:
        """Return the residuals of primal `x` (n,) and multipliers `y` (m,)."""
        if problem.matrices_changed or not self._fresh:
            self._matrix.data[:] = np.concatenate([problem.P, problem.A])[self._sources]
            self._fresh = True
        product: Floats = np.asarray(self._matrix @ np.concatenate([x, y]))
        pull, value = product[: self._n], product[self._n :]
        primal = max(float((problem.l - value).max()), float((value - problem.u).max()), 0.0)
        dual = float(np.abs(pull + problem.q).max()) / (1.0 + float(np.abs(problem.q).max()))
        # x'Px from what is there: x'(Px + A'y) - y'Ax.
        quadratic, linear = float(x @ pull) - float(y @ value), float(problem.q @ x)
        # The dual cost takes each multiplier at the bound its sign pushes against; at an open bound that is infinite.
        with np.errstate(invalid="ignore"):
            pushing = np.where(y > 0.0, y * problem.u, y * problem.l)
        support = float(pushing[np.abs(y) > _NO_PUSH].sum())
        gap = abs(quadratic + linear + support) / (1.0 + max(abs(quadratic), abs(linear), abs(support)))
        return Residuals(primal, dual, gap)
