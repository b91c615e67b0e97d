"""PIQP (Schwan et al. 2023): a proximal interior-point method on the sparse problem."""

from __future__ import annotations

from typing import Any

import numpy as np
import piqp
from scipy import sparse

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats
from controller.mpc.solver import INFEASIBLE, ITERATIONS, UNBOUNDED, Outcome, Solver, clipped
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

_INFINITY = 1e30
_ITERATIONS_MAX = 100  # it converges in 10 to 20, each as dear as twenty of OSQP's
# An interior point's gap closes by orders of magnitude per step: what OSQP's accuracy asks for, and the multipliers
# that our own residuals look at, cost one step more.
_TIGHTER = 1e-2
_SOLVED, _REACHED = piqp.PIQP_SOLVED, piqp.PIQP_MAX_ITER_REACHED
_REASONS = {
    piqp.PIQP_PRIMAL_INFEASIBLE: INFEASIBLE,
    piqp.PIQP_DUAL_INFEASIBLE: UNBOUNDED,
    _REACHED: ITERATIONS,
}


class PiqpSolver(Solver):
    """PIQP with its symbolic factorisation kept between steps; interior points take no warm start."""

    def __init__(self, structure: Structure, config: MpcConfig, workspace: Workspace) -> None:
        super().__init__(structure, config, workspace)
        constraints = structure.constraints
        entries = np.arange(1.0, len(constraints.indices) + 1)
        numbered = sparse.csc_matrix((entries, constraints.indices, constraints.indptr), constraints.shape)
        equations = structure.dynamics
        # The rows come apart into equations and limits; each part remembers where its numbers lie in A.
        self._parts = [sparse.csc_matrix(part) for part in (numbered[:equations], numbered[equations:])]
        self._sources = [part.data.astype(np.int64) - 1 for part in self._parts]
        cost = structure.cost
        self._cost = sparse.csc_matrix((workspace.P, cost.indices, cost.indptr), cost.shape)
        self._low: Floats = np.zeros(constraints.shape[0] - equations)
        self._high: Floats = np.zeros(constraints.shape[0] - equations)

    def _answer(self, fresh: bool, matrices_changed: bool) -> Outcome:
        workspace, equations = self.workspace, self.structure.dynamics
        low = clipped(workspace.lower[equations:], _INFINITY, self._low)
        high = clipped(workspace.upper[equations:], _INFINITY, self._high)
        right = workspace.lower[:equations]
        if fresh or matrices_changed:
            np.copyto(self._cost.data, workspace.P)
            for part, sources in zip(self._parts, self._sources, strict=True):
                np.take(workspace.A, sources, out=part.data, mode="clip")
        if fresh:
            self._solver: Any = piqp.SparseSolver()
            settings = self._solver.settings
            settings.eps_abs = settings.eps_rel = _TIGHTER * self.config.accuracy
            settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = _TIGHTER * self.config.accuracy
            settings.max_iter = min(self.config.max_iterations, _ITERATIONS_MAX)
            settings.compute_timings = True
            self._solver.setup(self._cost, workspace.q, self._parts[0], right, self._parts[1], low, high)
        elif matrices_changed:
            self._solver.update(
                P=self._cost, c=workspace.q, A=self._parts[0], b=right, G=self._parts[1], h_l=low, h_u=high
            )
        else:
            self._solver.update(c=workspace.q, b=right, h_l=low, h_u=high)
        status = self._solver.solve()
        result = self._solver.result
        answered = status in {_SOLVED, _REACHED}
        if answered:
            np.copyto(workspace.x, result.x)
            workspace.y[:equations] = result.y
            np.subtract(result.z_u, result.z_l, out=workspace.y[equations:])
        info = result.info
        time_s = float(info.update_time) + float(info.solve_time)
        return Outcome(str(status), answered, _REASONS.get(status, ""), int(info.iter), time_s)
