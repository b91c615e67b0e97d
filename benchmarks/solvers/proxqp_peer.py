"""ProxQP on the sparse problem."""

from __future__ import annotations

from typing import Any

import numpy as np
from proxsuite import proxqp
from scipy import sparse

from benchmarks.solvers.peer import Instance, Sparse, symmetric
from controller.mpc.structure import Structure


class ProxQp:
    """ProxQP's sparse solver, set up in every step: updated in place, it calls answers solved that are off by half."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)
        self._shape = structure.cost.shape[0], structure.dynamics, structure.constraints.shape[0] - structure.dynamics

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
        solver = proxqp.sparse.QP(*self._shape)
        solver.settings.eps_abs = 1e-5
        solver.settings.max_iter = 1000
        solver.init(*prepared)
        solver.solve()
        solved = solver.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return np.array(solver.results.x[:4]) if solved else None
