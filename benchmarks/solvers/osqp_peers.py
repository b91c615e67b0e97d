"""OSQP built anew in each step, and CasADi's conic('osqp'), on the sparse problem."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import osqp

from benchmarks.solvers.peer import Instance, Sparse
from controller.mpc.structure import Structure

ACCURACY = 1e-5


class OsqpAnew:
    """OSQP set up in every step, its own scaling on."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)

    def prepare(self, instance: Instance) -> Any:
        return self._sparse.cost(instance), instance.q, self._sparse.rows(instance), instance.l, instance.u

    def solve(self, prepared: Any) -> np.ndarray | None:
        solver = osqp.OSQP()
        solver.setup(*prepared, verbose=False, eps_abs=ACCURACY, eps_rel=ACCURACY, max_iter=4000)
        result = solver.solve(raise_error=False)
        return np.array(result.x[:4]) if result.info.status_val == 1 else None


class CasadiConic:
    """`casadi.conic('osqp')`, built once, started from the last answer."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)
        n, m = structure.cost.shape[0], structure.constraints.shape[0]
        upper = ca.Sparsity(n, n, structure.cost.indptr.tolist(), structure.cost.indices.tolist())
        rows = structure.constraints
        self._rows = ca.Sparsity(m, n, rows.indptr.tolist(), rows.indices.tolist())
        self._upper = upper
        self._hessian = ca.triu2symm(ca.DM(upper, 1.0)).sparsity()
        options = {
            "osqp": {"verbose": False, "eps_abs": ACCURACY, "eps_rel": ACCURACY, "max_iter": 4000},
            "error_on_fail": False,
            "warm_start_primal": True,
            "warm_start_dual": True,
        }
        self._solver = ca.conic("peer", "osqp", {"h": self._hessian, "a": self._rows}, options)
        self._last: dict[str, Any] = {}

    def prepare(self, instance: Instance) -> Any:
        return {
            "h": ca.triu2symm(ca.DM(self._upper, instance.P)),
            "g": instance.q,
            "a": ca.DM(self._rows, instance.A),
            "lba": instance.l,
            "uba": instance.u,
        }

    def solve(self, prepared: Any) -> np.ndarray | None:
        result = self._solver(**prepared, **self._last)
        if not self._solver.stats()["success"]:
            self._last = {}
            return None
        self._last = {"x0": result["x"], "lam_a0": result["lam_a"]}
        return np.array(result["x"][:4]).ravel()
