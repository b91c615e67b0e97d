"""The optimal control problem, written once with CasADi: its sparse structure and the functions that fill it.

Decision per stage k = 0..N-1, each divided by its scale: acceleration a_k, velocity v_{k+1} and displacement p_{k+1}
at the stage's end (4 each: x, y, yaw, height). The state (p, v) has 8 entries, the input a has 4. Displacements
count from the present pose along the present base frame; that the frame turns during the horizon is left out:
it is second order in time and nil in the first stage, the only one applied.

    min  sum_k |r_k|_W^2 / 2 + w |a_k - a_{k-1}|^2 / 2
    s.t. p_{k+1} = p_k + dt v_k + dt^2 a_k / 2,   v_{k+1} = v_k + dt a_k
         limits on a_k, a_k - a_{k-1}, v_{k+1}, wheel speed, stroke, wheel torque, traction, tip-over

with the admittance's residual `r_k = M a_k + D_k v + (K_k + K_hold) p - f_k + load_k` averaged over the stage
(`controller.admittance.one_step`); the first one over the control period, for that is how long a_0 is applied.

Limits that involve the person's wrench cannot always be kept: nobody asks a walker before pushing it with 1 kN.
Slacks with an exact penalty would allow for it, but a penalty large enough to be exact (some hundred times the
cost's own scale) takes a solver thousands of iterations. So the bounds themselves are opened, to just what the
*give-way* motion needs: the acceleration ramped at the largest jerk to the nearest one that drives, floor and
balance allow (`MachineLimits.give_way`). That is the least violation in reach, what an exact penalty would
find at infinite weight, and since that motion obeys every row the problem always has a solution. Jerk is never opened,
acceleration by `_OPENING` at most. The motion the plan starts from is the commanded one, which `MotionLimits` keeps
viable, so no measurement can break velocity or stroke.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bridge.messages import Floats
from controller.machine_limits import TIP_ROWS, MachineLimits
from controller.mpc import symbolic_walker
from controller.walker import Walker

Indices = NDArray[np.int64]

# Scaling of rows for ADMM: it converges fastest where loose rows weigh little and tight ones much. Tuned on
# the benchmark's sequence; the rows that end up tight together are tip-over against velocity.
JERK_SCALE = 0.25
VELOCITY_SCALE = 3.0
DRIVE_SCALE = 0.3
TIP_SCALE = 0.9

# The plan keeps this far off kinematic limits that the limiter behind it enforces to the last digit, so that
# the solver's tolerance never makes the limiter cut a plan.
RESERVE = 1e-3
_OPENING = 2e-2  # beyond the give-way motion: a problem without an interior takes ADMM a hundred times as long


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
    fading: Floats  # (N,) part of the present wrench left at each stage
    stroke_m: tuple[float, float]  # of the column

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


class Point(NamedTuple):
    """Where each quantity lies in the argument `point` (20,) of `vectors`."""

    height: slice = slice(0, 1)  # commanded [m]
    linearised: slice = slice(1, 2)  # height at which tip-over rows were taken [m]
    velocity: slice = slice(2, 6)  # commanded [m/s, rad/s]
    previous: slice = slice(6, 10)  # acceleration applied until now [m/s^2, rad/s^2]
    wrench: slice = slice(10, 16)  # of the person at the interface [N, N m]
    draw: slice = slice(16, 20)  # force of the coupling to the measured motion [N, N, N m, N]


POINT = Point()
POINT_SIZE = 20


@dataclass(frozen=True, eq=False)
class Structure:
    """Patterns, row layout and functions of the problem, arrays flat in rows of stages.

    `matrices(damping (4N,), stiffness (4N,), linearised (1,)) -> P (upper non-zeros), A (non-zeros)`
    `vectors(point (20,), damping, stiffness, load (4N,)) -> q, l, u, tip-over now: rows (4 x 4), then limits (4,)`
    """

    setting: Setting
    cost: Pattern  # upper triangle of the Hessian
    constraints: Pattern
    rows: dict[str, Indices]  # kind -> its rows of the constraint matrix, in one piece, (stages, width)
    matrices: Any  # casadi.Function
    vectors: Any  # casadi.Function

    @property
    def dynamics(self) -> int:
        """How many rows, the first ones, are the dynamics: equations."""
        return 8 * self.setting.stages

    @property
    def scale(self) -> Floats:
        """What one unit of each decision is worth, (N, 12)."""
        setting = self.setting
        stage = np.concatenate([setting.acceleration, setting.velocity, setting.displacement])
        return np.tile(stage, (setting.stages, 1))


def acceleration_index(stage: int, axis: int) -> int:
    """Return the decision's index of an acceleration."""
    return 12 * stage + axis


def velocity_index(stage: int, axis: int) -> int:
    """Return the decision's index of the velocity at a stage's end."""
    return 12 * stage + 4 + axis


def displacement_index(stage: int, axis: int) -> int:
    """Return the decision's index of the displacement at a stage's end."""
    return 12 * stage + 8 + axis


def build(setting: Setting, walker: Walker, limits: MachineLimits) -> Structure:
    """Write the problem symbolically and take its structure."""
    N, dt = setting.stages, setting.stage_s
    w, point, linearised = ca.SX.sym("w", 12 * N), ca.SX.sym("point", POINT_SIZE), ca.SX.sym("linearised")
    damping, stiffness, load = (ca.SX.sym(name, 4 * N) for name in ("damping", "stiffness", "load"))
    height, at_height, v0, a_previous, wrench, draw = (point[where] for where in POINT)
    machine = symbolic_walker.rows(walker, limits, symbolic_walker.terms(walker, linearised, ca.SX.zeros(4)))
    a_max, v_max, p_max, mass, jerk = (
        ca.DM(x) for x in (setting.acceleration, setting.velocity, setting.displacement, setting.mass, setting.jerk)
    )

    now = symbolic_walker.terms(walker, height, v0)
    machine_now = ca.substitute(machine, linearised, at_height)
    allowed = symbolic_walker.bounds(walker, limits, now, machine_now, wrench, setting.fading)
    push = now.interface.T @ wrench + draw

    cost = ca.SX(0)
    blocks: dict[str, list[tuple[Any, Any, Any]]] = {}
    p, v, before = ca.SX.zeros(4), v0, a_previous
    zero, one = ca.SX.zeros(4), ca.SX.ones(4)
    slow, fastest = (1.0 - RESERVE) * one, VELOCITY_SCALE * (1.0 - RESERVE) * one
    for k in range(N):
        a = a_max * w[12 * k : 12 * k + 4]
        v_next = v_max * w[12 * k + 4 : 12 * k + 8]
        p_next = p_max * w[12 * k + 8 : 12 * k + 12]

        half = 0.5 * (setting.period_s if k == 0 else dt)
        at = slice(4 * k, 4 * k + 4)
        residual = (
            mass * a
            + damping[at] * (v + half * a)
            + stiffness[at] * (p + half * v + half**2 * a)
            - (float(setting.fading[k]) * push - load[at])
        ) / (mass * a_max)
        cost += 0.5 * ca.sumsqr(residual) + 0.5 * setting.increment_weight * ca.sumsqr((a - before) / a_max)

        column_low, column_high = allowed.column_low[k] / a_max[3], allowed.column_high[k] / a_max[3]
        room = (jerk * (setting.period_s if k == 0 else dt)) / JERK_SCALE
        stage: dict[str, tuple[Any, Any, Any]] = {
            "velocity_dynamics": (4.0 * (v_next - v - dt * a) / v_max, zero, zero),
            "displacement_dynamics": ((p_next - p - dt * v - 0.5 * dt**2 * a) / (v_max * dt), zero, zero),
            "acceleration": (a / a_max, ca.vertcat(-one[:3], column_low), ca.vertcat(one[:3], column_high)),
            "jerk": ((a - before) / room, -JERK_SCALE * one, JERK_SCALE * one),
        }
        if k in setting.sparse_stages:
            drive_low, drive_high = DRIVE_SCALE * allowed.low[:, k], DRIVE_SCALE * allowed.high[: TIP_ROWS.start, k]
            ends = [(end - height) / p_max[3] for end in setting.stroke_m]
            stage["velocity"] = (VELOCITY_SCALE * v_next / v_max, -fastest, fastest)
            stage["wheel_speed"] = (ca.DM(setting.wheel_speed) @ v_next[:3], -slow, slow)
            stage["stroke"] = (p_next[3] / p_max[3], ends[0], ends[1])
            stage["drive"] = (DRIVE_SCALE * (machine[: TIP_ROWS.start, :] @ a), drive_low, drive_high)
        tip_high = TIP_SCALE * allowed.high[TIP_ROWS, k]
        stage["tip_over"] = (TIP_SCALE * (machine[TIP_ROWS, :] @ a), -ca.inf * one, tip_high)
        for kind, parts in stage.items():
            blocks.setdefault(kind, []).append(parts)
        p, v, before = p_next, v_next, a

    rows = _layout({kind: (len(pieces), pieces[0][0].shape[0]) for kind, pieces in blocks.items()})
    constraints, low, high = (
        ca.vertcat(*(parts[part] for pieces in blocks.values() for parts in pieces)) for part in range(3)
    )

    hessian, gradient = ca.hessian(cost, w)
    upper = ca.triu(hessian)
    jacobian = ca.jacobian(constraints, w)
    at_zero, offset = ca.substitute([gradient, constraints], [w], [ca.DM.zeros(w.shape[0])])
    tipping = ca.vertcat(ca.vec(machine_now[TIP_ROWS, :].T), allowed.high[TIP_ROWS, 0])
    motion = _give_way_motion(setting, allowed.give_way, v0, a_previous)
    needed = ca.substitute(jacobian, linearised, at_height) @ motion + offset
    opening = ca.DM(np.where(np.isin(np.arange(constraints.shape[0]), rows["jerk"]), 0.0, _OPENING))
    first = 8 * N  # limit; the dynamics come before and are equations
    low[first:] = ca.fmin(low, needed - opening)[first:]
    high[first:] = ca.fmax(high, needed + opening)[first:]
    return Structure(
        setting=setting,
        cost=_pattern(upper),
        constraints=_pattern(jacobian),
        rows=rows,
        matrices=ca.Function("matrices", [damping, stiffness, linearised], [_nonzeros(upper), _nonzeros(jacobian)]),
        vectors=ca.Function(
            "vectors",
            [point, damping, stiffness, load],
            [ca.densify(part) for part in (at_zero, low - offset, high - offset, tipping)],
        ),
    )


def _give_way_motion(setting: Setting, give_way: Any, velocity: Any, previous: Any) -> Any:
    """Return, as a decision, the motion that ramps to `give_way`, and back before velocity leaves its limit."""
    N, dt = setting.stages, setting.stage_s
    accelerations = ca.SX.zeros(N, 4)
    for axis in range(4):
        jerk, fade = float(setting.jerk[axis]), float(setting.jerk[axis]) * dt
        wanted, start = give_way[axis], previous[axis]
        ramp = [
            start + ca.fmin(ca.fmax(wanted - start, -reach), reach)
            for reach in (jerk * (setting.period_s + k * dt) for k in range(N))
        ]
        # Fading may begin at any stage; the last one that still ends inside the velocity limit is taken.
        sign = ca.sign(wanted)
        gone, options = ca.SX(0), []
        longest = math.ceil(float(setting.acceleration[axis]) / fade) + 1
        for n in range(N):
            gone += ramp[n]
            reached = ca.fabs(ramp[n])
            after = sum((ca.fmax(reached - fade * j, 0.0) for j in range(1, min(longest, N - n))), ca.SX(0))
            options.append(sign * velocity[axis] + dt * sign * (gone + ca.sign(ramp[n]) * after))
        inside = sum((end <= (1.0 - RESERVE) * float(setting.velocity[axis]) for end in options), ca.SX(0))
        best = ca.fmax(inside - 1.0, 0.0)
        last = sum((ca.if_else(best == n, ramp[n], 0.0) for n in range(N)), ca.SX(0))
        for k in range(N):
            faded = ca.sign(last) * ca.fmax(ca.fabs(last) - fade * (k - best), 0.0)
            accelerations[k, axis] = ca.if_else(ca.logic_or(wanted == 0.0, k <= best), ramp[k], faded)
    motion = []
    p, v = ca.SX.zeros(4), velocity
    for k in range(N):
        a = accelerations[k, :].T
        p, v = p + dt * v + 0.5 * dt**2 * a, v + dt * a
        motion += [a / setting.acceleration, v / setting.velocity, p / setting.displacement]
    return ca.vertcat(*motion)


def _layout(shapes: dict[str, tuple[int, int]]) -> dict[str, Indices]:
    rows, first = {}, 0
    for kind, (stages, width) in shapes.items():
        rows[kind] = first + np.arange(stages * width).reshape(stages, width)
        first += stages * width
    return rows


def _pattern(matrix: Any) -> Pattern:
    columns, rows = matrix.sparsity().get_ccs()
    return Pattern(matrix.shape, np.array(columns, dtype=np.int64), np.array(rows, dtype=np.int64))


def _nonzeros(matrix: Any) -> Any:
    return ca.vertcat(*matrix.nonzeros())
