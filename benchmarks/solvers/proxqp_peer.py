"""ProxQP on the sparse problem."""

from __future__ import annotations

from typing import Any

import numpy as np
from proxsuite import proxqp
from scipy import sparse

from benchmarks.solvers.peer import Instance, Sparse, symmetric
from controller.mpc.structure import Structure


class ProxQp:
    """ProxQP's sparse solver, updated, started cold: warm starts made it call solvable problems infeasible."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)
        self._solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        equations = structure.dynamics
        n, limits = structure.cost.shape[0], structure.constraints.shape[0] - equations
        self._solver = proxqp.sparse.QP(n, equations, limits)
        self._solver.settings.eps_abs = 1e-5
        self._solver.settings.max_iter = 1000
        self._solver.settings.initial_guess = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
        self._fresh = True

    def prepare(self, instance: Instance) -> Any:
        rows, equations = self._sparse.rows(instance).tocsr(), self._sparse.equations
        return (
            symmetric(self._sparse.cost(instance)),
            instance.q,
            sparse.csc_matrix(rows[:equations]),
            instance.l[:equations],
            sparse.csc_matrix(rows[equations:]),
            np.clip(instance.l[equations:], -1e20, None),
            np.clip(instance.u[equations:], None, 1e20),
        )

    def solve(self, prepared: Any) -> np.ndarray | None:
        if self._fresh:
            self._solver.init(*prepared)
            self._fresh = False
        else:
            self._solver.update(*prepared)
        self._solver.solve()
        results = self._solver.results
        return np.array(results.x[:4]) if results.info.status == self._solved else None
