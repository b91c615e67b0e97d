"""PIQP on the sparse problem."""

from __future__ import annotations

from typing import Any

import numpy as np
import piqp
from scipy import sparse

from benchmarks.solvers.peer import Instance, Sparse
from controller.mpc.structure import Structure


class Piqp:
    """PIQP's sparse solver, set up once and updated."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)
        self._solver = piqp.SparseSolver()
        settings = self._solver.settings
        settings.eps_abs = settings.eps_rel = settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = 1e-7
        self._fresh = True

    def prepare(self, instance: Instance) -> Any:
        rows, equations = self._sparse.rows(instance).tocsr(), self._sparse.equations
        limits = np.clip(instance.l[equations:], -1e30, None), np.clip(instance.u[equations:], None, 1e30)
        return (
            self._sparse.cost(instance),
            instance.q,
            sparse.csc_matrix(rows[:equations]),
            instance.l[:equations],
            sparse.csc_matrix(rows[equations:]),
            *limits,
            instance.matrices_changed,
        )

    def solve(self, prepared: Any) -> np.ndarray | None:
        P, q, A, b, G, low, high, changed = prepared
        if self._fresh:
            self._solver.setup(P, q, A, b, G, low, high)
            self._fresh = False
        elif changed:
            self._solver.update(P=P, c=q, A=A, b=b, G=G, h_l=low, h_u=high)
        else:
            self._solver.update(c=q, b=b, h_l=low, h_u=high)
        status = self._solver.solve()
        return np.array(self._solver.result.x[:4]) if status == piqp.PIQP_SOLVED else None
