"""DAQP (Arnstrom, Bemporad and Axehed 2022): a dual active-set method on the condensed problem, exact in a few steps.

It needs the limits that push, not many small iterations: none in free walking, nine at most in the benchmark. The
condensed problem comes as a ball (`controller.mpc.condensing`), so DAQP's own factorisation, most of its time
otherwise, has nothing to do. The limits that pushed last time are its warm start.
"""

from __future__ import annotations

import math

import daqp
import numpy as np

from bridge.config.mpc import MpcConfig
from controller.mpc.solver import INFEASIBLE, ITERATIONS, TIME, UNBOUNDED, Outcome, Solver
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

_SOLVED, _UNBOUNDED, _ITERATIONS, _TIME = 1, -3, -4, -7
_SAID = {
    _SOLVED: "solved",
    -1: "infeasible",
    -2: "cycling",
    _UNBOUNDED: "unbounded",
    _ITERATIONS: "iteration limit",
    -5: "not convex",
    -6: "overdetermined start",
    _TIME: "time limit",
}
_REASONS = {-1: INFEASIBLE, _UNBOUNDED: UNBOUNDED, _ITERATIONS: ITERATIONS, _TIME: TIME}
_FEASIBLE = 1e-7  # violation of a limit, scaled to a unit row, that DAQP takes for none


class DaqpSolver(Solver):
    """DAQP with its working set kept between steps."""

    def __init__(self, structure: Structure, config: MpcConfig, workspace: Workspace) -> None:
        super().__init__(structure, config, workspace)
        self._ball = np.eye(len(workspace.z))

    def _answer(self, fresh: bool, matrices_changed: bool) -> Outcome:
        workspace = self.workspace
        if fresh or matrices_changed:
            workspace.condense()
            # A cost without curvature has no root.
            if not math.isfinite(workspace.U.sum()):
                return Outcome("not convex", False, UNBOUNDED)
        workspace.reduce()
        if fresh:
            self._model = daqp.Model()
            self._model.settings = {
                "primal_tol": _FEASIBLE,
                "iter_limit": self.config.max_iterations,
                "time_limit": self.config.time_limit_s,
            }
            flag = self._model.setup(self._ball, workspace.f, workspace.M, workspace.high, workspace.low)[0]
        elif matrices_changed:
            flag = self._model.update(f=workspace.f, A=workspace.M, bupper=workspace.high, blower=workspace.low)
        else:
            flag = self._model.update(f=workspace.f, bupper=workspace.high, blower=workspace.low)
        if flag < 0:
            return Outcome(_SAID.get(flag, str(flag)), False, _REASONS.get(flag, ""))
        answer, _, flag, info = self._model.solve()
        time_s, iterations = float(info["solve_time"]), int(info["iterations"])
        said: str = _SAID.get(flag, str(flag))
        answered = flag in {_SOLVED, _ITERATIONS}
        if answered:
            np.copyto(workspace.z, answer)
            np.copyto(workspace.multipliers, info["lam"])
            workspace.expand()
        return Outcome(said, answered, _REASONS.get(flag, ""), iterations, time_s)
