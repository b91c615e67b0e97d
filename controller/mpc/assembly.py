"""Fills the problem's numbers with NumPy: the values CasADi would give (tested), in microseconds.

Limits that involve the person's wrench cannot always be kept: nobody asks a walker before pushing it with 1 kN.
Slacks with an exact penalty would allow for it, but a penalty large enough to be exact (some hundred times the
cost's own scale) takes the solver thousands of iterations. So the bounds themselves are opened, to just what the
*give-way* motion needs: the acceleration ramped at the largest jerk to the nearest one that drives, floor and
balance allow (`MachineLimits.give_way`). That is the least violation in reach, what an exact penalty would
find at infinite weight, and since that motion obeys every row the problem always has a solution. Acceleration and jerk
are never opened. The motion the plan starts from is the commanded one, which `MotionLimits` keeps viable, so no
measurement can break velocity or stroke.
"""

from __future__ import annotations

import numpy as np

from bridge.messages import Floats
from controller.admittance import AdmittanceStages
from controller.machine_limits import DRIVE_ROWS, TIP_ROWS, MachineBounds
from controller.mpc.problem import Problem
from controller.mpc.structure import (
    DRIVE_SCALE,
    JERK_SCALE,
    TIP_SCALE,
    VELOCITY_SCALE,
    Structure,
    acceleration_index,
    displacement_index,
    velocity_index,
)

# The plan keeps this far off kinematic limits that the limiter behind it enforces to the last digit, so that
# the solver's tolerance never makes the limiter cut a plan.
_RESERVE = 1e-3
_OPENING = 2e-2  # beyond the give-way motion: a problem without an interior takes the solver a hundred times as long


class Assembly:
    """Fills problems on one structure; keeps the arrays and what they were last filled from."""

    def __init__(self, structure: Structure, machine_rows: Floats, stroke_m: tuple[float, float]) -> None:
        setting = structure.setting
        self._setting = setting
        self._stroke_m = stroke_m
        N = setting.stages
        self._sparse = np.array(setting.sparse_stages)
        zeros, zero = np.zeros((N, 4)), np.zeros(4)
        parameters = (zeros, zeros, zeros, zero, zero, machine_rows)
        self._P: Floats = np.array(structure.cost_values(*parameters)).ravel()
        self._A: Floats = np.array(structure.constraint_values(*parameters)).ravel()
        self._q: Floats = np.array(structure.gradient(*parameters)).ravel()
        self._l: Floats = np.zeros(structure.constraints.shape[0])
        self._u: Floats = np.zeros(structure.constraints.shape[0])
        # Lower and upper limits of each kind of row, as views of l and u.
        self._limits = {kind: (structure.view(self._l, kind), structure.view(self._u, kind)) for kind in structure.rows}
        self._limits["jerk"][0][:], self._limits["jerk"][1][:] = -JERK_SCALE, JERK_SCALE
        self._limits["tip_over"][0][:] = -np.inf
        self._map_cost(structure)
        self._map_constraints(structure)
        # Instants at which a stage's acceleration may have changed: one period, then whole stages.
        self._since_previous: Floats = (setting.period_s + setting.stage_s * np.arange(N, dtype=np.float64))[:, None]
        self._weights: Floats = 1.0 / (setting.mass * setting.acceleration)
        self._per_velocity: Floats = VELOCITY_SCALE / setting.velocity
        self._per_acceleration: Floats = 1.0 / setting.acceleration
        self._wheel_map: Floats = np.ascontiguousarray(setting.wheel_speed.T)
        self._law: tuple[bytes, bytes] | None = None
        self._tip: Floats = machine_rows[TIP_ROWS].copy()

    def fill(
        self,
        law: AdmittanceStages,
        force: Floats,
        velocity: Floats,
        previous: Floats,
        height_m: float,
        machine_rows: Floats,
        bounds: MachineBounds,
        give_way: Floats,
    ) -> Problem:
        """Return the problem of this step; its arrays are the assembly's own and change with the next call.

        Args:
            law: the admittance over the horizon.
            force: (N, 4) generalised force of the person, predicted.
            velocity: (4,) commanded velocity now.
            previous: (4,) acceleration applied until now.
            height_m: commanded column height now [m].
            machine_rows: (12, 4) rows of `MachineLimits`.
            bounds: limits of the machine under the predicted wrench.
            give_way: (4,) acceleration that the machine can hold.
        """
        changed = self._fill_matrices(law, machine_rows)
        self._fill_gradient(law, force - law.load, velocity, previous)
        self._fill_bounds(velocity, previous, height_m, machine_rows, bounds, give_way)
        return Problem(self._P, self._q, self._A, self._l, self._u, changed)

    def _map_cost(self, structure: Structure) -> None:
        """Find where each product of residual coefficients goes; the increments' part is there already."""
        N, pattern = self._setting.stages, structure.cost
        self._increments: Floats = self._P.copy()
        first = np.array([pattern.position(axis, axis) for axis in range(4)])
        pairs = np.empty((6, N - 1, 4), dtype=np.int64)
        for k in range(1, N):
            for axis in range(4):
                a = acceleration_index(k, axis)
                v, p = velocity_index(k - 1, axis), displacement_index(k - 1, axis)
                # Columns in order of index: v and p of the stage before come first.
                for pair, (row, column) in enumerate(((v, v), (p, p), (a, a), (v, p), (v, a), (p, a))):
                    pairs[pair, k - 1, axis] = pattern.position(row, column)
        self._cost_first, self._cost_pairs = first, pairs
        # Built at D = K = 0 the values hold the mass's part too; take it out to be left with the increments.
        self._increments[first] -= 1.0
        self._increments[pairs[2]] -= 1.0

    def _map_constraints(self, structure: Structure) -> None:
        rows = structure.rows["tip_over"]
        self._tip_positions = np.array(
            [
                [
                    [structure.constraints.position(rows[k, edge], acceleration_index(k, axis)) for axis in range(4)]
                    for edge in range(4)
                ]
                for k in range(self._setting.stages)
            ]
        )

    def _coefficients(self, law: AdmittanceStages) -> tuple[Floats, Floats, Floats]:
        """Return what the scaled a, v, p weigh in each residual (N, 4); at stage 0 v and p are given."""
        setting = self._setting
        half = np.full((setting.stages, 1), 0.5 * setting.stage_s)
        half[0] = 0.5 * setting.period_s
        by_v = law.damping + half * law.stiffness
        by_a = law.mass + half * law.damping + half**2 * law.stiffness
        scale = self._weights
        return (
            by_a * (setting.acceleration * scale),
            by_v * (setting.velocity * scale),
            law.stiffness * (setting.displacement * scale),
        )

    def _fill_matrices(self, law: AdmittanceStages, machine_rows: Floats) -> bool:
        key = (law.damping.tobytes(), law.stiffness.tobytes())
        changed = False
        if key != self._law:
            self._law = key
            self._by_a, self._by_v, self._by_p = self._coefficients(law)
            a, v, p = self._by_a[1:], self._by_v[1:], self._by_p[1:]
            self._P[:] = self._increments
            self._P[self._cost_first] += self._by_a[0] ** 2
            self._P[self._cost_pairs] += np.stack([v * v, p * p, a * a, v * p, v * a, p * a])
            changed = True
        if not np.array_equal(machine_rows[TIP_ROWS], self._tip):
            self._tip[:] = machine_rows[TIP_ROWS]
            self._A[self._tip_positions] = TIP_SCALE * self._tip * self._setting.acceleration
            changed = True
        return changed

    def _fill_gradient(self, law: AdmittanceStages, force: Floats, velocity: Floats, previous: Floats) -> None:
        setting = self._setting
        N = setting.stages
        given = force * -self._weights
        half = 0.5 * setting.period_s
        given[0] += (law.damping[0] + half * law.stiffness[0]) * velocity * self._weights
        stages = self._q.reshape(N, 12)
        np.multiply(self._by_a, given, out=stages[:, 0:4])
        stages[0, 0:4] -= setting.increment_weight * previous / setting.acceleration
        np.multiply(self._by_v[1:], given[1:], out=stages[:-1, 4:8])
        np.multiply(self._by_p[1:], given[1:], out=stages[:-1, 8:12])

    def _give_way_motion(self, give_way: Floats, velocity: Floats, previous: Floats) -> Floats:
        """Return the accelerations (N, 4) that ramp to `give_way` and back to zero before velocity leaves its limit."""
        setting = self._setting
        reach = setting.jerk * self._since_previous
        ramp: Floats = previous + np.clip(give_way - previous, -reach, reach)
        count = np.arange(setting.stages)
        for axis in np.flatnonzero(give_way):
            sign = np.sign(give_way[axis])
            # One row for each stage at which to begin fading; the last that ends inside the limit is taken.
            fade = setting.jerk[axis] * setting.stage_s * np.maximum(count - count[:, None], 0)
            reached = sign * ramp[np.minimum(count, count[:, None]), axis]
            options = np.sign(reached) * np.maximum(np.abs(reached) - fade, 0.0)
            end = sign * velocity[axis] + setting.stage_s * options.sum(axis=1)
            best = max(int(np.sum(end <= (1.0 - _RESERVE) * setting.velocity[axis])) - 1, 0)
            ramp[:, axis] = sign * options[best]
        return ramp

    def _fill_bounds(
        self,
        velocity: Floats,
        previous: Floats,
        height_m: float,
        machine_rows: Floats,
        bounds: MachineBounds,
        give_way: Floats,
    ) -> None:
        setting, limits = self._setting, self._limits
        dt, per_acceleration = setting.stage_s, self._per_acceleration
        # The give-way motion, at every stage.
        ramp = self._give_way_motion(give_way, velocity, previous)
        speed = ramp.cumsum(axis=0)
        speed *= dt
        speed += velocity
        for side in limits["velocity_dynamics"]:
            np.multiply(velocity, 4.0 / setting.velocity, out=side[0])
        for side in limits["displacement_dynamics"]:
            np.divide(velocity, setting.velocity, out=side[0])
        shift = JERK_SCALE * previous / (setting.jerk * setting.period_s)
        low, high = limits["jerk"]
        low[0], high[0] = shift - JERK_SCALE, shift + JERK_SCALE
        _open(
            limits["acceleration"],
            bounds.box_low * per_acceleration,
            bounds.box_high * per_acceleration,
            ramp * per_acceleration,
        )
        most = 1.0 - _RESERVE
        held = speed[self._sparse]
        _open(limits["velocity"], -VELOCITY_SCALE * most, VELOCITY_SCALE * most, held * self._per_velocity)
        _open(limits["wheel_speed"], -most, most, held[:, :3] @ self._wheel_map)
        # Height at the stages' ends by the trapezoidal rule.
        column = speed[:, 3]
        way = ((column.cumsum() - 0.5 * column + 0.5 * velocity[3]) * (dt / setting.displacement[3]))[self._sparse]
        low_m, high_m = self._stroke_m
        scale = setting.displacement[3]
        _open(limits["stroke"], (low_m - height_m) / scale, (high_m - height_m) / scale, way[:, None])
        carried = ramp @ machine_rows.T
        sparse = self._sparse
        _open(
            limits["drive"],
            bounds.low[sparse, DRIVE_ROWS] * DRIVE_SCALE,
            bounds.high[sparse, DRIVE_ROWS] * DRIVE_SCALE,
            carried[sparse, DRIVE_ROWS] * DRIVE_SCALE,
        )
        np.maximum(bounds.high[:, TIP_ROWS], carried[:, TIP_ROWS] + _OPENING, out=limits["tip_over"][1])
        limits["tip_over"][1][:] *= TIP_SCALE


def _open(limits: tuple[Floats, Floats], low: Floats | float, high: Floats | float, motion: Floats) -> None:
    """Write limits, opened to what a motion needs."""
    np.minimum(low, motion - _OPENING, out=limits[0])
    np.maximum(high, motion + _OPENING, out=limits[1])
