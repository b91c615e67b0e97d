"""What a problem must be before it is solved, and an answer before it is a plan: counted without any solver."""

from __future__ import annotations

from typing import Any

import casadi as ca

from controller.mpc.structure import Structure
from controller.mpc.symbols import as_matrix, problem_symbols

_NO_PUSH = 1e-9  # a multiplier this small pushes against nothing


def flaws(structure: Structure) -> Any:
    """Return `flaws(P, q, A, l, u) -> (4,)`: sums of P, q and A, and how many pairs of bounds are not in order.

    A sum is finite only if every term is; a bound that is not a number is in no order.
    """
    P, q, A, lower, upper = problem_symbols(structure)
    crossed = lower.size1() - ca.sum1(lower <= upper)
    return ca.Function("flaws", [P, q, A, lower, upper], [ca.vertcat(ca.sum1(P), ca.sum1(q), ca.sum1(A), crossed)])


def residuals(structure: Structure) -> Any:
    """Return `residuals(P, q, A, l, u, x, y) -> (3,)`: feasibility, stationarity, duality gap (`plan.Residuals`)."""
    P, q, A, lower, upper = problem_symbols(structure)
    x, y = ca.SX.sym("x", structure.cost.shape[0]), ca.SX.sym("y", structure.constraints.shape[0])
    matrix = as_matrix(structure.constraints, A)
    curved = ca.triu2symm(as_matrix(structure.cost, P)) @ x
    value = matrix @ x
    pull = curved + q + matrix.T @ y
    primal = ca.fmax(ca.fmax(ca.mmax(lower - value), ca.mmax(value - upper)), 0.0)
    dual = ca.mmax(ca.fabs(pull)) / (1.0 + ca.mmax(ca.fabs(q)))
    quadratic, linear = ca.dot(x, curved), ca.dot(q, x)
    # The dual cost takes each multiplier at the bound its sign pushes against; at an open bound that is infinite.
    support = ca.sum1(ca.if_else(y > _NO_PUSH, y * upper, 0.0) + ca.if_else(y < -_NO_PUSH, y * lower, 0.0))
    size = ca.fmax(ca.fmax(ca.fabs(quadratic), ca.fabs(linear)), ca.fabs(support))
    gap = ca.fabs(quadratic + linear + support) / (1.0 + size)
    # A maximum passes over what is not a number; a sum does not.
    whole = ca.sum1(x) + ca.sum1(y)
    return ca.Function("residuals", [P, q, A, lower, upper, x, y], [ca.vertcat(primal, dual, gap, whole)])
