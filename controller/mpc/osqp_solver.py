"""OSQP (Stellato et al. 2020): ADMM on the sparse problem, set up once, updated in place."""

from __future__ import annotations

from typing import Any

import numpy as np
import osqp
from scipy import sparse

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats
from controller.mpc.solver import INFEASIBLE, ITERATIONS, TIME, UNBOUNDED, Outcome, Solver, clipped
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

CHECK_EVERY = 10  # iterations
_SOLVED = 1
# Statuses that come with an answer. Whether it is a plan is decided by our own residuals.
_ANSWERED = {
    _SOLVED: "",
    2: "the solver stopped short of its accuracy",
    7: ITERATIONS,
    8: TIME,
}
_REASONS = {3: INFEASIBLE, 4: INFEASIBLE, 5: UNBOUNDED, 6: UNBOUNDED}
INFINITY = float(osqp.constant("OSQP_INFTY"))


class OsqpSolver(Solver):
    """OSQP with its workspace and warm start kept between steps."""

    def __init__(self, structure: Structure, config: MpcConfig, workspace: Workspace) -> None:
        super().__init__(structure, config, workspace)
        self._low: Floats = np.zeros(structure.constraints.shape[0])
        self._high: Floats = np.zeros(structure.constraints.shape[0])
        self._adapted = False

    def _answer(self, fresh: bool, matrices_changed: bool) -> Outcome:
        workspace = self.workspace
        low, high = clipped(workspace.lower, INFINITY, self._low), clipped(workspace.upper, INFINITY, self._high)
        if fresh:
            self._solver: Any = bindings(self.structure, self.config, workspace, low, high)
        else:
            if self._adapted:
                self._solver.update_rho(self.config.step_size)
            self._solver.update_data_vec(workspace.q, low, high)
            if matrices_changed:
                self._solver.update_data_mat(workspace.P, None, workspace.A, None)
        self._solver.solve()
        info = self._solver.info
        self._adapted = int(info.rho_updates) > 0
        status = int(info.status_val)
        answered = status in _ANSWERED
        if answered:
            answer = self._solver.solution
            np.copyto(workspace.x, answer.x)
            np.copyto(workspace.y, answer.y)
        reason = _ANSWERED[status] if answered else _REASONS.get(status, "")
        return Outcome(str(info.status), answered, reason, int(info.iter), float(info.run_time))


def bindings(structure: Structure, config: MpcConfig, workspace: Workspace, low: Floats, high: Floats) -> Any:
    """Return OSQP set up on the workspace's problem, its settings from `[mpc]`."""
    # The bindings themselves: osqp.OSQP would copy the bounds, keep every result for derivatives, and take a
    # tenth of the step for it.
    module: Any = osqp.OSQP().ext
    settings = module.OSQPSettings()
    module.osqp_set_default_settings(settings)
    settings.verbose = False
    settings.eps_abs = settings.eps_rel = config.accuracy
    settings.max_iter = config.max_iterations
    settings.time_limit = config.time_limit_s
    settings.check_termination = CHECK_EVERY
    # The problem comes scaled, with rows weighted for the solver; its own scaling undoes that and costs a pass
    # over the matrices in every update. The step size adapts only after 50 iterations, which ordinary
    # steps do not need; what a hard step made of it is taken back for the next.
    settings.scaling = 0
    settings.rho = config.step_size
    settings.adaptive_rho = 1
    settings.warm_starting = True
    cost, constraints = structure.cost, structure.constraints
    return module.OSQPSolver(
        module.CSC(sparse.csc_matrix((workspace.P, cost.indices, cost.indptr), cost.shape)),
        workspace.q,
        module.CSC(sparse.csc_matrix((workspace.A, constraints.indices, constraints.indptr), constraints.shape)),
        low,
        high,
        constraints.shape[0],
        constraints.shape[1],
        settings,
    )
