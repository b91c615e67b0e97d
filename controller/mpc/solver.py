"""OSQP behind a small interface: set up once, updated in place, never believed without a check."""

from __future__ import annotations

import math
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
_MAX = np.maximum.reduce


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
        self._infinity = float(osqp.constant("OSQP_INFTY"))
        self._low: Floats = np.zeros(structure.constraints.shape[0])
        self._high: Floats = np.zeros(structure.constraints.shape[0])
        self._stale = True
        self._adapted = False

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
        else:
            if self._adapted:
                self._solver.update_rho(self._config.step_size)
            low, high = self._finite(problem)
            self._solver.update_data_vec(problem.q, low, high)
            if problem.matrices_changed:
                self._solver.update_data_mat(problem.P, None, problem.A, None)
        self._solver.solve()
        info = self._solver.info
        self._adapted = int(info.rho_updates) > 0
        status = int(info.status_val)
        spent = float(info.run_time)
        iterations = int(info.iter)

        def failure(reason: str, residuals: Residuals | None = None) -> Failure:
            return Failure(reason, str(info.status), iterations, residuals, spent)

        if status not in _ANSWERED:
            # The iterates are rays or worse: a warm start from them would poison every later solve.
            self._stale = True
            return failure(_REASONS.get(status, "the solver failed"))
        answer = self._solver.solution
        x, y = np.asarray(answer.x), np.asarray(answer.y)
        # A sum is finite only if every term is.
        if not math.isfinite(float(x.sum()) + float(y.sum())):
            self._stale = True
            return failure("the solver's answer is not finite")
        residuals = self._residuals(problem, x, y)
        worst, limit = max(residuals), self._config.residual_max
        # What is not a number is not below the limit either.
        if not all(value <= limit for value in residuals):
            # Said to be solved and is not: something is wrong with the workspace.
            self._stale = status == _SOLVED
            off = f"the answer is off by {worst:.1e}, limit {limit:.1e}"
            return failure(f"{_ANSWERED[status]}, {off}" if status != _SOLVED else off, residuals)
        return Plan(x.reshape(self._scale.shape) * self._scale, residuals, iterations, spent)

    def _finite(self, problem: Problem) -> tuple[Floats, Floats]:
        """Return the bounds with what the solver takes for infinite in the place of what is."""
        np.maximum(problem.l, -self._infinity, out=self._low)
        np.minimum(problem.u, self._infinity, out=self._high)
        return self._low, self._high

    def _setup(self, problem: Problem) -> None:
        config, cost, constraints = self._config, self._structure.cost, self._structure.constraints
        # The bindings themselves: osqp.OSQP would copy the bounds, keep every result for derivatives, and take a
        # tenth of the step for it.
        bindings: Any = osqp.OSQP().ext
        settings = bindings.OSQPSettings()
        bindings.osqp_set_default_settings(settings)
        settings.verbose = False
        settings.eps_abs = settings.eps_rel = config.accuracy
        settings.max_iter = config.max_iterations
        settings.time_limit = config.time_limit_s
        settings.check_termination = 10
        # The problem comes scaled, with rows weighted for the solver; its own scaling undoes that and costs a pass
        # over the matrices in every update. The step size adapts only after 50 iterations, which ordinary
        # steps do not need; what a hard step made of it is taken back for the next.
        settings.scaling = 0
        settings.rho = config.step_size
        settings.adaptive_rho = 1
        settings.warm_starting = True
        low, high = self._finite(problem)
        self._solver: Any = bindings.OSQPSolver(
            bindings.CSC(sparse.csc_matrix((problem.P, cost.indices, cost.indptr), cost.shape)),
            problem.q,
            bindings.CSC(sparse.csc_matrix((problem.A, constraints.indices, constraints.indptr), constraints.shape)),
            low,
            high,
            constraints.shape[0],
            constraints.shape[1],
            settings,
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
        self._values: Floats = np.zeros(count + len(constraints.indices))
        self._cost_values, self._constraint_values = self._values[:count], self._values[count:]
        self._answer: Floats = np.zeros(self._matrix.shape[0])
        self._fresh = False

    def __call__(self, problem: Problem, x: Floats, y: Floats) -> Residuals:
        """Return the residuals of primal `x` (n,) and multipliers `y` (m,)."""
        if problem.matrices_changed or not self._fresh:
            self._cost_values[:], self._constraint_values[:] = problem.P, problem.A
            np.take(self._values, self._sources, out=self._matrix.data, mode="clip")
            self._fresh = True
        n, q = self._n, problem.q
        self._answer[:n], self._answer[n:] = x, y
        product: Floats = np.asarray(self._matrix @ self._answer)
        pull, value = product[:n], product[n:]
        # x'Px from what is there: x'(Px + A'y) - y'Ax.
        quadratic, linear = float(x @ pull) - float(y @ value), float(q @ x)
        pull += q
        dual = float(_MAX(np.abs(pull, out=pull))) / (1.0 + float(_MAX(np.abs(q))))
        # The dual cost takes each multiplier at the bound its sign pushes against; at an open bound that is infinite.
        pushing = (np.abs(y) > _NO_PUSH).nonzero()[0]
        force = y[pushing]
        support = float(force @ np.where(force > 0.0, problem.u[pushing], problem.l[pushing]))
        gap = abs(quadratic + linear + support) / (1.0 + max(abs(quadratic), abs(linear), abs(support)))
        above = float(_MAX(value - problem.u))
        primal = max(float(_MAX(np.subtract(problem.l, value, out=value))), above, 0.0)
        return Residuals(primal, dual, gap)
