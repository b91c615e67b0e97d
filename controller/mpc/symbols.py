"""The problem's numbers as CasADi symbols: what code is generated from."""

from __future__ import annotations

from typing import Any

import casadi as ca

from controller.mpc.structure import Pattern, Structure


def problem_symbols(structure: Structure) -> tuple[Any, Any, Any, Any, Any]:
    """Return the stored entries of P, q, A and both bounds as column vectors."""
    n, m = structure.cost.shape[0], structure.constraints.shape[0]
    sizes = (len(structure.cost.indices), n, len(structure.constraints.indices), m, m)
    P, q, A, lower, upper = (ca.SX.sym(name, size) for name, size in zip("PqAlu", sizes, strict=True))
    return P, q, A, lower, upper


def as_matrix(pattern: Pattern, values: Any) -> Any:
    """Return a sparse matrix of `pattern` with its stored entries `values`, column by column."""
    sparsity = ca.Sparsity(*pattern.shape, pattern.indptr.tolist(), pattern.indices.tolist())
    return ca.SX(sparsity, values)
