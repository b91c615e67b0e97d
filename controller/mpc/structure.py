"""The optimal control problem, written once with CasADi: its sparse structure and the exact values to test against.

Decision per stage k = 0..N-1, each divided by its scale: acceleration a_k, velocity v_{k+1} and displacement p_{k+1}
at the stage's end (4 each: x, y, yaw, height). The state (p, v) has 8 entries, the input a has 4. Displacements
count from the present pose along the present base frame; that the frame turns during the horizon is left out:
it is second order in time and nil in the first stage, the only one applied.

    min  sum_k |r_k|_W^2 / 2 + w |a_k - a_{k-1}|^2 / 2
    s.t. p_{k+1} = p_k + dt v_k + dt^2 a_k / 2,   v_{k+1} = v_k + dt a_k
         limits on a_k, a_k - a_{k-1}, v_{k+1}, wheel speed, stroke, wheel torque, traction, tip-over

with the admittance's residual `r_k = M a_k + D_k v + (K_k + K_hold) p - f_k + load_k` averaged over the stage
(`controller.admittance.one_step`); the first one over the control period, for that is how long a_0 is applied.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bridge.messages import Floats
from controller.machine_limits import ROWS, TIP_ROWS

Indices = NDArray[np.int64]

# Scaling of rows for the solver: ADMM converges fastest where loose rows weigh little and tight ones much. Tuned on
# the benchmark's sequence; the rows that end up tight together are tip-over against velocity.
JERK_SCALE = 0.25
VELOCITY_SCALE = 3.0
DRIVE_SCALE = 0.3
TIP_SCALE = 0.9


class Setting(NamedTuple):
    """What does not change while the controller runs."""

    stages: int
    stage_s: float
    period_s: float
    acceleration: Floats  # (4,) limits, also scales
    velocity: Floats  # (4,)
    jerk: Floats  # (4,)
    wheel_speed: Floats  # (4, 3) wheel Jacobian over the wheels' largest speed
    mass: Floats  # (4,) rendered mass
    increment_weight: float

    @property
    def displacement(self) -> Floats:
        """Scale of displacements (4,): a quarter of a second at the largest velocity."""
        return 0.25 * self.velocity

    @property
    def sparse_stages(self) -> tuple[int, ...]:
        """Stages at which velocity, wheel speed, stroke and the drives are limited: the first three, then every third.

        Between them jerk and acceleration leave little room, and long before the horizon moves there the plan
        has been made anew. Acceleration, jerk and tip-over are limited at every stage.
        """
        last = self.stages - 1
        return tuple(k for k in range(self.stages) if k < 3 or k % 3 == 1 or k == last)


class Pattern(NamedTuple):
    """Sparsity of a matrix in compressed columns."""

    shape: tuple[int, int]
    indptr: Indices
    indices: Indices

    def position(self, row: int, column: int) -> int:
        """Return where the value of an entry lies among the non-zeros."""
        start, end = self.indptr[column], self.indptr[column + 1]
        found = start + int(np.searchsorted(self.indices[start:end], row))
        if found >= end or self.indices[found] != row:
            raise LookupError(f"entry ({row}, {column}) is not in the pattern")
        return int(found)


@dataclass(frozen=True)
class Structure:
    """Patterns, row layout and exact value functions of the problem.

    Functions take `(damping (N,4), stiffness (N,4), force (N,4), v0 (4,), a_previous (4,), rows (12,4))`, where
    force is what the law's right side comes to: `f_k - load_k`.
    """

    setting: Setting
    cost: Pattern  # upper triangle of the Hessian
    constraints: Pattern
    rows: dict[str, Indices]  # kind -> its rows of the constraint matrix, in one piece, (stages, width)
    cost_values: Any  # casadi.Function -> Hessian's upper non-zeros
    gradient: Any  # casadi.Function -> gradient at zero
    constraint_values: Any  # casadi.Function -> non-zeros
    constraint_offset: Any  # casadi.Function -> constraints at zero

    def view(self, values: Floats, kind: str) -> Floats:
        """Return the entries of a row vector (m,) that belong to a kind, as (its stages, its width)."""
        rows = self.rows[kind]
        return values[rows[0, 0] : rows[-1, -1] + 1].reshape(rows.shape)


def acceleration_index(stage: int, axis: int) -> int:
    """Return the decision's index of an acceleration."""
    return 12 * stage + axis


def velocity_index(stage: int, axis: int) -> int:
    """Return the decision's index of the velocity at a stage's end."""
    return 12 * stage + 4 + axis


def displacement_index(stage: int, axis: int) -> int:
    """Return the decision's index of the displacement at a stage's end."""
    return 12 * stage + 8 + axis


def build(setting: Setting) -> Structure:
    """Write the problem symbolically and take its structure."""
    N, dt = setting.stages, setting.stage_s
    w = ca.SX.sym("w", 12 * N)
    damping, stiffness, force = (ca.SX.sym(name, N, 4) for name in ("damping", "stiffness", "force"))
    v0, a_previous, machine = ca.SX.sym("v0", 4), ca.SX.sym("a_previous", 4), ca.SX.sym("machine", ROWS, 4)
    a_max, v_max, p_max = (ca.DM(x) for x in (setting.acceleration, setting.velocity, setting.displacement))
    mass, jerk = ca.DM(setting.mass), ca.DM(setting.jerk)

    cost = ca.SX(0)
    blocks: dict[str, list[Any]] = {}
    p, v, before = ca.SX.zeros(4), v0, a_previous
    for k in range(N):
        a = a_max * w[12 * k : 12 * k + 4]
        v_next = v_max * w[12 * k + 4 : 12 * k + 8]
        p_next = p_max * w[12 * k + 8 : 12 * k + 12]

        half = 0.5 * (setting.period_s if k == 0 else dt)
        residual = (
            mass * a
            + damping[k, :].T * (v + half * a)
            + stiffness[k, :].T * (p + half * v + half**2 * a)
            - force[k, :].T
        ) / (mass * a_max)
        cost += 0.5 * ca.sumsqr(residual) + 0.5 * setting.increment_weight * ca.sumsqr((a - before) / a_max)

        stage: dict[str, Any] = {
            "velocity_dynamics": 4.0 * (v_next - v - dt * a) / v_max,
            "displacement_dynamics": (p_next - p - dt * v - 0.5 * dt**2 * a) / (v_max * dt),
            "acceleration": a / a_max,
            "jerk": JERK_SCALE * (a - before) / (jerk * (setting.period_s if k == 0 else dt)),
        }
        if k in setting.sparse_stages:
            stage["velocity"] = VELOCITY_SCALE * v_next / v_max
            stage["wheel_speed"] = ca.DM(setting.wheel_speed) @ v_next[:3]
            stage["stroke"] = p_next[3] / p_max[3]
            stage["drive"] = DRIVE_SCALE * (machine[: TIP_ROWS.start, :] @ a)
        stage["tip_over"] = TIP_SCALE * (machine[TIP_ROWS.start :, :] @ a)
        for kind, rows in stage.items():
            blocks.setdefault(kind, []).append(rows)
        p, v, before = p_next, v_next, a

    rows, first = {}, 0
    for kind, parts in blocks.items():
        width = parts[0].shape[0]
        rows[kind] = first + np.arange(len(parts) * width).reshape(len(parts), width)
        first += len(parts) * width
    constraints = ca.vertcat(*(part for parts in blocks.values() for part in parts))

    hessian, gradient = ca.hessian(cost, w)
    upper = ca.triu(hessian)
    jacobian = ca.jacobian(constraints, w)
    parameters = [damping, stiffness, force, v0, a_previous, machine]

    def at_zero(expression: Any) -> Any:
        return ca.substitute(expression, w, ca.DM.zeros(w.shape[0]))

    def function(name: str, expression: Any) -> Any:
        return ca.Function(name, parameters, [expression])

    return Structure(
        setting=setting,
        cost=_pattern(upper),
        constraints=_pattern(jacobian),
        rows=rows,
        cost_values=function("cost_values", _nonzeros(upper)),
        gradient=function("gradient", at_zero(gradient)),
        constraint_values=function("constraint_values", _nonzeros(jacobian)),
        constraint_offset=function("constraint_offset", at_zero(constraints)),
    )


def _pattern(matrix: Any) -> Pattern:
    columns, rows = matrix.sparsity().get_ccs()
    return Pattern(matrix.shape, np.array(columns, dtype=np.int64), np.array(rows, dtype=np.int64))


def _nonzeros(matrix: Any) -> Any:
    return ca.vertcat(*matrix.nonzeros())
