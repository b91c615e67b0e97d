"""The problem in its inputs alone, turned so that the cost is a ball: what a dense active-set solver takes fastest.

States follow from inputs, `w = Z u + w_0` with the dynamics' constant Z, so the cost is `u' H u / 2 + f' u`. H falls
into one block per axis, since the admittance couples none; with `H = R' R` and `u = R^-1 z` it becomes
`|z|^2 / 2 + (R^-T f)' z`, and the limits `M z` with `M = A Z R^-1`. That is the least-distance form that
DAQP (Arnstrom, Bemporad and Axehed 2022) works in; made here axis by axis it takes a tenth of the time of the
general one, which sees a dense matrix.

`condense` reads the problem's own numbers, not what they were made from, so it serves whatever problem it is given.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from bridge.messages import Floats
from controller.mpc.structure import (
    Indices,
    Pattern,
    Structure,
    acceleration_index,
    displacement_index,
    velocity_index,
)
from controller.mpc.symbols import as_matrix, problem_symbols

OPEN = 1e30  # what DAQP takes for no bound


@dataclass(frozen=True)
class Condensed:
    """Where the condensed problem's numbers come from and go to, and the functions that turn them.

    The functions are written when they are first asked for: loops.c stands in for them where there is a compiler.
    """

    structure: Structure
    cost_sources: Indices  # (4, n) where each number of one axis' P lies in (P, 0)
    constraint_sources: Indices  # (4, n) likewise in (A, 0)
    dynamics: Floats  # (4, 3) what a_k adds to v and p, and v_k to p, over one stage
    own_rows: tuple[slice, ...]  # of M: limits on one axis alone
    shared_rows: slice  # of M: limits that couple the axes
    order: Indices  # (rows of M,) the full problem's row of each

    @cached_property
    def condense(self) -> Any:
        """`condense(P of one axis, A of one axis, dynamics of one axis) -> R^-1 (N, N), M own (rows, N), M shared`."""
        return _condense(self.structure.setting.stages, self.structure.setting.sparse_stages)

    @cached_property
    def reduce(self) -> Any:
        """`reduce(P, q, A, l, u, R^-1 (4N, N)) -> R^-T f (4N,), lower, upper limits of M z`."""
        return _reduce(self.structure, self.dynamics, self.order)

    @cached_property
    def expand(self) -> Any:
        """`expand(z, multipliers of M z, R^-1, P, q, A, l) -> x, y` of the full problem."""
        return _expand(self.structure, self.dynamics, self.order)

    @property
    def size(self) -> tuple[int, int]:
        """Shape of M."""
        return len(self.order), self.dynamics.shape[0] * (self.cost_sources.shape[1] // _PER_STAGE)


_PER_STAGE = 7  # numbers of one axis' cost per stage: aa, a a-before, vv, vp, va, pa, pp


def build(structure: Structure) -> Condensed:
    """Lay the condensed problem of a structure out."""
    setting = structure.setting
    N, dt = setting.stages, setting.stage_s
    a_max, v_max, p_max = setting.acceleration, setting.velocity, setting.displacement
    dynamics = np.stack([dt * a_max / v_max, 0.5 * dt**2 * a_max / p_max, dt * v_max / p_max], axis=1)

    kinds = structure.rows
    own = [np.concatenate([kinds[kind][:, axis] for kind in ("acceleration", "jerk", "velocity")]) for axis in range(4)]
    own[3] = np.concatenate([own[3], kinds["stroke"].ravel()])
    shared = np.concatenate([kinds[kind].ravel() for kind in ("wheel_speed", "drive", "tip_over")])
    order = np.concatenate([*own, shared])
    ends = np.cumsum([0] + [len(rows) for rows in own])
    return Condensed(
        structure=structure,
        cost_sources=np.stack([_cost_sources(structure.cost, N, axis) for axis in range(4)]),
        constraint_sources=np.stack([_constraint_sources(structure, axis) for axis in range(4)]),
        dynamics=np.ascontiguousarray(dynamics),
        own_rows=tuple(slice(int(ends[axis]), int(ends[axis + 1])) for axis in range(4)),
        shared_rows=slice(int(ends[4]), len(order)),
        order=order,
    )


def _cost_sources(pattern: Pattern, stages: int, axis: int) -> Indices:
    nowhere = len(pattern.indices)
    sources = np.full((stages, _PER_STAGE), nowhere)
    for k in range(stages):
        a = acceleration_index(k, axis)
        sources[k, 0] = pattern.position(a, a)
        if k:
            before = acceleration_index(k - 1, axis)
            v, p = velocity_index(k - 1, axis), displacement_index(k - 1, axis)
            # Columns in order of index: v and p of the stage before come first.
            for place, (row, column) in enumerate(((before, a), (v, v), (v, p), (v, a), (p, a), (p, p)), start=1):
                sources[k, place] = _position(pattern, row, column)
    return sources.ravel()


def _constraint_sources(structure: Structure, axis: int) -> Indices:
    pattern, rows, limited = structure.constraints, structure.rows, structure.setting.sparse_stages
    found = []
    for k in range(structure.setting.stages):
        a, before = acceleration_index(k, axis), acceleration_index(max(k - 1, 0), axis)
        found.append(_position(pattern, rows["acceleration"][k, axis], a))
        found.append(_position(pattern, rows["jerk"][k, axis], a))
        found.append(_position(pattern, rows["jerk"][k, axis], before) if k else len(pattern.indices))
        found += [_position(pattern, row, a) for row in rows["tip_over"][k]]
    for place, k in enumerate(limited):
        a, v, p = acceleration_index(k, axis), velocity_index(k, axis), displacement_index(k, axis)
        found.append(_position(pattern, rows["velocity"][place, axis], v))
        found.append(_position(pattern, rows["stroke"][place, 0], p))
        found += [_position(pattern, row, v) for row in rows["wheel_speed"][place]]
        found += [_position(pattern, row, a) for row in rows["drive"][place]]
    return np.array(found, dtype=np.int64)


def _position(pattern: Pattern, row: int, column: int) -> int:
    """Return where an entry lies among the non-zeros, one past them if it has none."""
    try:
        return pattern.position(int(row), column)
    except LookupError:
        return len(pattern.indices)


def _condense(N: int, limited: tuple[int, ...]) -> Any:
    cost, dynamics = ca.SX.sym("cost", _PER_STAGE * N), ca.SX.sym("dynamics", 3)
    by_a, square, by_v = ca.vertsplit(dynamics)  # v += by_a a;  p += square a + by_v v
    aa, before, vv, vp, va, pa, pp = (ca.vertsplit(cost[entry::_PER_STAGE]) for entry in range(_PER_STAGE))
    # v before stage k is by_a (a_0 + ... + a_{k-1}); in p before stage k, a_j weighs first[k] - slope j.
    slope = by_v * by_a
    first = [slope * (k - 1) + square for k in range(N)]
    # Sums over the stages behind j make every entry of H a few products.
    s0, s1, s2 = ([ca.SX(0)] * (N + 1) for _ in range(3))
    for k in range(N - 1, 0, -1):
        s0[k] = s0[k + 1] + vv[k] * by_a**2 + 2.0 * vp[k] * by_a * first[k] + pp[k] * first[k] ** 2
        s1[k] = s1[k + 1] + vp[k] * by_a + pp[k] * first[k]
        s2[k] = s2[k + 1] + pp[k]
    H = [[ca.SX(0)] * N for _ in range(N)]
    for j in range(N):
        for i in range(j + 1):
            H[i][j] = s0[j + 1] - slope * (i + j) * s1[j + 1] + slope**2 * (i * j) * s2[j + 1]
            if i < j:
                H[i][j] += va[j] * by_a + pa[j] * (first[j] - slope * i)
        H[j][j] += aa[j]
        if j:
            H[j - 1][j] += before[j]
    U = _inverse(_cholesky(H))

    entries = ca.SX.sym("constraints", 7 * N + 14 * len(limited))
    at = iter(ca.vertsplit(entries))
    zero = [ca.SX(0)] * N
    acceleration, jerk, tip, velocity, stroke, wheel, drive = ([] for _ in range(7))
    for k in range(N):
        acceleration.append(_times(next(at), U[k]))
        now, then = next(at), next(at)
        jerk.append([now * a + then * b for a, b in zip(U[k], U[k - 1] if k else zero, strict=True)])
        tip += [_times(next(at), U[k]) for _ in range(4)]
    v, p = zero, zero
    for k in range(N):
        p = [old + by_v * speed + square * a for old, speed, a in zip(p, v, U[k], strict=True)]
        v = [old + by_a * a for old, a in zip(v, U[k], strict=True)]
        if k in limited:
            velocity.append(_times(next(at), v))
            stroke.append(_times(next(at), p))
            wheel += [_times(next(at), v) for _ in range(4)]
            drive += [_times(next(at), U[k]) for _ in range(8)]
    own, shared = [*acceleration, *jerk, *velocity, *stroke], [*wheel, *drive, *tip]
    return ca.Function("condense", [cost, entries, dynamics], [_by_rows(U), _by_rows(own), _by_rows(shared)])


def _reduce(structure: Structure, dynamics: Floats, order: Indices) -> Any:
    N = structure.setting.stages
    P, q, A, lower, upper = problem_symbols(structure)
    U = ca.SX.sym("U", N * N, 4)
    free = _free_motion(N, dynamics, lower)
    gradient = _symmetric(structure, P) @ free + q
    f = _to_inputs(N, dynamics, gradient)
    turned = [
        sum((U[N * k + column, axis] * f[k][axis] for k in range(column + 1)), ca.SX(0))
        for axis in range(4)
        for column in range(N)
    ]
    limited = as_matrix(structure.constraints, A) @ free
    rows = [int(row) for row in order]
    low, high = (lower - limited)[rows], (upper - limited)[rows]
    results = [ca.vertcat(*turned), ca.fmax(low, -OPEN), ca.fmin(high, OPEN)]
    return ca.Function("reduce", [P, q, A, lower, upper, U], results)


def _expand(structure: Structure, dynamics: Floats, order: Indices) -> Any:
    N = structure.setting.stages
    P, q, A, lower, _ = problem_symbols(structure)
    U, z = ca.SX.sym("U", N * N, 4), ca.SX.sym("z", 4 * N)
    multipliers = ca.SX.sym("multipliers", len(order))
    x = _free_motion(N, dynamics, lower)
    v, p = [ca.SX(0)] * 4, [ca.SX(0)] * 4
    for k in range(N):
        for axis in range(4):
            by_a, square, by_v = (float(value) for value in dynamics[axis])
            a = sum((U[N * k + column, axis] * z[N * axis + column] for column in range(k, N)), ca.SX(0))
            p[axis] = p[axis] + by_v * v[axis] + square * a
            v[axis] = v[axis] + by_a * a
            x[acceleration_index(k, axis)] = a
            x[velocity_index(k, axis)] += v[axis]
            x[displacement_index(k, axis)] += p[axis]
    y = ca.SX.zeros(structure.constraints.shape[0])
    y[[int(row) for row in order]] = multipliers
    # What the dynamics' multipliers must be for the gradient to vanish along the states.
    pull = _symmetric(structure, P) @ x + q + as_matrix(structure.constraints, A).T @ y
    for axis in range(4):
        by_v = float(dynamics[axis, 2])
        after_v, after_p = ca.SX(0), ca.SX(0)
        for k in reversed(range(N)):
            at_v = after_v + 0.25 * (after_p - pull[velocity_index(k, axis)])
            after_p = after_p - by_v * pull[displacement_index(k, axis)]
            after_v = at_v
            y[int(structure.rows["velocity_dynamics"][k, axis])] = after_v
            y[int(structure.rows["displacement_dynamics"][k, axis])] = after_p
    return ca.Function("expand", [z, multipliers, U, P, q, A, lower], [ca.densify(x), ca.densify(y)])


def _symmetric(structure: Structure, P: Any) -> Any:
    return ca.triu2symm(as_matrix(structure.cost, P))


def _free_motion(N: int, dynamics: Floats, lower: Any) -> Any:
    """Return the decision without acceleration: what the dynamics' right side moves."""
    x = ca.SX.zeros(12 * N)
    for axis in range(4):
        by_v = float(dynamics[axis, 2])
        v, p = ca.SX(0), ca.SX(0)
        for k in range(N):
            p = p + by_v * (v + lower[4 * N + 4 * k + axis])
            v = v + 0.25 * lower[4 * k + axis]
            x[velocity_index(k, axis)], x[displacement_index(k, axis)] = v, p
    return x


def _to_inputs(N: int, dynamics: Floats, gradient: Any) -> list[list[Any]]:
    """Return the gradient by inputs (N, 4) of one by all decisions: the adjoint of the dynamics."""
    result = [[ca.SX(0)] * 4 for _ in range(N)]
    for axis in range(4):
        by_a, square, by_v = (float(value) for value in dynamics[axis])
        to_v, to_p = ca.SX(0), ca.SX(0)
        for k in reversed(range(N)):
            to_v = to_v + by_v * to_p + gradient[velocity_index(k, axis)]
            to_p = to_p + gradient[displacement_index(k, axis)]
            result[k][axis] = gradient[acceleration_index(k, axis)] + by_a * to_v + square * to_p
    return result


def _cholesky(H: list[list[Any]]) -> list[list[Any]]:
    """Return the upper triangle R with R' R = H."""
    N = len(H)
    R = [[ca.SX(0)] * N for _ in range(N)]
    for i in range(N):
        R[i][i] = ca.sqrt(H[i][i] - sum((R[k][i] ** 2 for k in range(i)), ca.SX(0)))
        for j in range(i + 1, N):
            R[i][j] = (H[i][j] - sum((R[k][i] * R[k][j] for k in range(i)), ca.SX(0))) / R[i][i]
    return R


def _inverse(R: list[list[Any]]) -> list[list[Any]]:
    N = len(R)
    U = [[ca.SX(0)] * N for _ in range(N)]
    for i in range(N):
        U[i][i] = 1.0 / R[i][i]
    for j in range(N):
        for i in reversed(range(j)):
            U[i][j] = -U[i][i] * sum((R[i][k] * U[k][j] for k in range(i + 1, j + 1)), ca.SX(0))
    return U


def _times(factor: Any, row: list[Any]) -> list[Any]:
    return [factor * value for value in row]


def _by_rows(rows: list[list[Any]]) -> Any:
    """Return rows one after the other, as a dense column."""
    return ca.densify(ca.vertcat(*(value for row in rows for value in row)))
