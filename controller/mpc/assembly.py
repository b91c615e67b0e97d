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
from scipy import sparse

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
        # Limits before they are opened, with views of each kind of row; what never changes is written here.
        self._low, self._high = np.zeros(len(self._l)), np.zeros(len(self._l))
        self._limits = {
            kind: (structure.view(self._low, kind), structure.view(self._high, kind)) for kind in structure.rows
        }
        most = 1.0 - _RESERVE
        for kind, limit in (
            ("acceleration", 1.0),
            ("jerk", JERK_SCALE),
            ("velocity", VELOCITY_SCALE * most),
            ("wheel_speed", most),
            ("tip_over", np.inf),
        ):
            self._limits[kind][0][:], self._limits[kind][1][:] = -limit, limit
        # The dynamics come first and are equations; jerk is never opened.
        self._first_limit = 8 * N
        self._opening: Floats = np.full(len(self._l), _OPENING)
        self._opening[structure.rows["jerk"]] = 0.0
        pattern = structure.constraints
        numbered = sparse.csc_matrix((np.arange(1.0, len(self._A) + 1), pattern.indices, pattern.indptr), pattern.shape)
        self._matrix = sparse.csr_matrix(numbered)
        self._matrix_sources = self._matrix.data.astype(np.int64) - 1
        self._matrix.data[:] = self._A[self._matrix_sources]
        self._motion: Floats = np.zeros((N, 12))
        self._weights: Floats = 1.0 / (setting.mass * setting.acceleration)
        self._per_increment: Floats = setting.increment_weight / setting.acceleration
        self._map_law()
        self._map_cost(structure)
        self._map_constraints(structure)
        # How far acceleration can have moved by each stage: one period, then whole stages.
        self._count = np.arange(N)
        self._reach: Floats = (
            setting.jerk * (setting.period_s + setting.stage_s * np.arange(N, dtype=np.float64))[:, None]
        )
        self._reach_down: Floats = -self._reach
        self._per_first_jerk: Floats = JERK_SCALE / (setting.jerk * setting.period_s)
        dt = setting.stage_s
        self._ramp: Floats = np.zeros((N, 4))
        sums = dt * np.tri(N)
        # dt (v_0 + ... + v_k) with half of the first and last, for speeds that are sums themselves.
        self._sums: Floats = np.concatenate([np.eye(N), sums, dt * (np.tri(N) - 0.5 * np.eye(N)) @ sums])
        self._ends: Floats = np.concatenate([np.zeros(N), np.ones(N), dt * np.arange(1.0, N + 1)])[:, None]
        limits = np.stack([setting.acceleration, setting.velocity, setting.displacement])
        self._per_limit: Floats = np.repeat(1.0 / limits, N, axis=0)
        self._per_velocity: Floats = 1.0 / setting.velocity
        self._law: tuple[bytes, bytes] | None = None
        self._tip = machine_rows[TIP_ROWS].tobytes()

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
        self._fill_bounds(velocity, previous, height_m, bounds, give_way)
        return Problem(self._P, self._q, self._A, self._l, self._u, changed)

    def _map_cost(self, structure: Structure) -> None:
        """Find the product of residual coefficients that each entry holds; the increments' part is there already."""
        N, pattern = self._setting.stages, structure.cost
        self._increments: Floats = self._P.copy()
        first = np.array([pattern.position(axis, axis) for axis in range(4)])
        pairs = np.empty((6, N, 4), dtype=np.int64)
        pairs[:, 0] = len(self._P)
        pairs[2, 0] = first
        for k in range(1, N):
            for axis in range(4):
                a = acceleration_index(k, axis)
                v, p = velocity_index(k - 1, axis), displacement_index(k - 1, axis)
                # Columns in order of index: v and p of the stage before come first.
                for pair, (row, column) in enumerate(((v, v), (p, p), (a, a), (v, p), (v, a), (p, a))):
                    pairs[pair, k, axis] = pattern.position(row, column)
        # At stage 0 velocity and displacement are given; their products go nowhere. What has no product takes a zero.
        self._products: Floats = np.zeros(6 * N * 4 + 1)
        source = np.full(len(self._P) + 1, 6 * N * 4)
        source[pairs.ravel()] = np.arange(6 * N * 4)
        self._cost_sources = source[:-1]
        # Built at D = K = 0 the values hold the mass's part too; take it out to be left with the increments.
        self._increments[pairs[2].ravel()] -= 1.0

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

    def _map_law(self) -> None:
        """Write what damping and stiffness (N, 4) weigh in the scaled coefficients of each residual."""
        setting = self._setting
        half = np.full((setting.stages, 1), 0.5 * setting.stage_s)
        half[0] = 0.5 * setting.period_s
        by_a, by_v, by_p = (
            scale * self._weights for scale in (setting.acceleration, setting.velocity, setting.displacement)
        )
        self._mass_by_a: Floats = setting.mass * by_a
        ones = np.ones_like(half)
        self._damping_by: Floats = np.stack([half * by_a, ones * by_v])
        self._stiffness_by: Floats = np.stack([half**2 * by_a, half * by_v, ones * by_p])
        self._by: Floats = np.zeros((3, setting.stages, 4))
        self._minus_weights: Floats = np.tile(-self._weights, (setting.stages, 1))
        # The gradient: acceleration of each stage, velocity and displacement at its end, which enter the residual of
        # the stage after; the last ones enter none.
        number = np.arange(self._by.size).reshape(self._by.shape)
        self._pulls_flat: Floats = np.zeros(self._by.size + 1)
        self._pulls = self._pulls_flat[:-1].reshape(self._by.shape)
        sources = np.full((setting.stages, 12), self._by.size)
        sources[:, 0:4] = number[0]
        sources[:-1, 4:8], sources[:-1, 8:12] = number[1, 1:], number[2, 1:]
        self._gradient_sources = sources.ravel()

    def _fill_matrices(self, law: AdmittanceStages, machine_rows: Floats) -> bool:
        key = (law.damping.tobytes(), law.stiffness.tobytes())
        changed = False
        if key != self._law:
            self._law = key
            # What the scaled a, v, p weigh in each residual (N, 4); at stage 0 v and p are given.
            by = self._by
            np.multiply(self._stiffness_by, law.stiffness, out=by)
            by[:2] += self._damping_by * law.damping
            by[0] += self._mass_by_a
            a, v, p = by
            products = self._products[:-1].reshape(6, -1, 4)
            for pair, (one, other) in enumerate(((v, v), (p, p), (a, a), (v, p), (v, a), (p, a))):
                np.multiply(one, other, out=products[pair])
            np.take(self._products, self._cost_sources, out=self._P, mode="clip")
            self._P += self._increments
            changed = True
        if machine_rows[TIP_ROWS].tobytes() != self._tip:
            self._tip = machine_rows[TIP_ROWS].tobytes()
            self._A[self._tip_positions] = TIP_SCALE * machine_rows[TIP_ROWS] * self._setting.acceleration
            np.take(self._A, self._matrix_sources, out=self._matrix.data, mode="clip")
            changed = True
        return changed

    def _fill_gradient(self, law: AdmittanceStages, force: Floats, velocity: Floats, previous: Floats) -> None:
        setting = self._setting
        given = force * self._minus_weights
        given[0] += (law.damping[0] + (0.5 * setting.period_s) * law.stiffness[0]) * velocity * self._weights
        np.multiply(self._by, given, out=self._pulls)
        np.take(self._pulls_flat, self._gradient_sources, out=self._q, mode="clip")
        self._q[:4] -= self._per_increment * previous

    def _give_way_motion(self, give_way: Floats, velocity: Floats, previous: Floats) -> Floats:
        """Return, as a decision, the motion that ramps to `give_way`, and back before velocity leaves its limit."""
        setting = self._setting
        N, dt = setting.stages, setting.stage_s
        ramp = give_way - previous
        np.minimum(np.maximum(ramp, self._reach_down), self._reach, out=self._ramp)
        ramp = self._ramp
        ramp += previous
        count = self._count
        for axis in [axis for axis, value in enumerate(give_way.tolist()) if value != 0.0]:
            sign = np.sign(give_way[axis])
            # One row for each stage at which to begin fading; the last that ends inside the limit is taken.
            fade = setting.jerk[axis] * dt * np.maximum(count - count[:, None], 0)
            reached = sign * ramp[np.minimum(count, count[:, None]), axis]
            options = np.sign(reached) * np.maximum(np.abs(reached) - fade, 0.0)
            end = sign * velocity[axis] + dt * options.sum(axis=1)
            best = max(int(np.sum(end <= (1.0 - _RESERVE) * setting.velocity[axis])) - 1, 0)
            ramp[:, axis] = sign * options[best]
        # Acceleration of each stage; velocity and displacement at its end are sums over the accelerations so far.
        sums = self._sums @ ramp
        sums += self._ends * velocity
        sums *= self._per_limit
        motion = self._motion.reshape(N, 3, 4)
        motion[:] = sums.reshape(3, N, 4).transpose(1, 0, 2)
        return self._motion.ravel()

    def _fill_bounds(
        self,
        velocity: Floats,
        previous: Floats,
        height_m: float,
        bounds: MachineBounds,
        give_way: Floats,
    ) -> None:
        setting, limits = self._setting, self._limits
        share = velocity * self._per_velocity
        for side in limits["displacement_dynamics"]:
            side[0] = share
        share *= 4.0
        for side in limits["velocity_dynamics"]:
            side[0] = share
        low, high = limits["acceleration"]
        most = setting.acceleration[3]
        np.divide(bounds.box_low[:, 3], most, out=low[:, 3])
        np.divide(bounds.box_high[:, 3], most, out=high[:, 3])
        low, high = limits["jerk"]
        shift = previous * self._per_first_jerk
        np.subtract(shift, JERK_SCALE, out=low[0])
        np.add(shift, JERK_SCALE, out=high[0])
        low, high = limits["stroke"]
        scale = float(setting.displacement[3])
        low.fill((self._stroke_m[0] - height_m) / scale)
        high.fill((self._stroke_m[1] - height_m) / scale)
        low, high = limits["drive"]
        np.multiply(bounds.low[self._sparse, DRIVE_ROWS], DRIVE_SCALE, out=low)
        np.multiply(bounds.high[self._sparse, DRIVE_ROWS], DRIVE_SCALE, out=high)
        np.multiply(bounds.high[:, TIP_ROWS], TIP_SCALE, out=limits["tip_over"][1])

        # What the give-way motion makes of every row opens the limits that it would break.
        needed: Floats = np.asarray(self._matrix @ self._give_way_motion(give_way, velocity, previous))
        first = self._first_limit
        np.minimum(self._low, needed - self._opening, out=self._l)
        needed += self._opening
        np.maximum(self._high, needed, out=self._u)
        self._l[:first] = self._low[:first]
        self._u[:first] = self._high[:first]
