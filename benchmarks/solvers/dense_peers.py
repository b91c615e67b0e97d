"""DAQP on the condensed problem, and the one-step clamped law."""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np

from benchmarks.solvers.peer import Instance, Sparse, symmetric
from bridge.config.walker import WalkerConfig
from controller.fallback import fallback_acceleration, within_machine
from controller.machine_limits import MachineLimits
from controller.motion_limits import MotionLimits
from controller.mpc.structure import Structure
from controller.walker import Walker


class Daqp:
    """DAQP's own model of the dense problem in the inputs, updated; condensing it is not counted."""

    def __init__(self, structure: Structure) -> None:
        self._sparse = Sparse(structure)
        N = structure.setting.stages
        self._inputs = np.array([12 * k + axis for k in range(N) for axis in range(4)])
        self._states = np.setdiff1d(np.arange(12 * N), self._inputs)
        self._model: Any = None
        self._to_states: np.ndarray | None = None

    def prepare(self, instance: Instance) -> Any:
        equations = self._sparse.equations
        cost, rows = symmetric(self._sparse.cost(instance)).toarray(), self._sparse.rows(instance).toarray()
        dynamics, limits = rows[:equations], rows[equations:]
        if self._to_states is None:  # the dynamics never change
            inverse = np.linalg.inv(dynamics[:, self._states])
            self._to_states = inverse
            self._Z = np.zeros((cost.shape[0], len(self._inputs)))
            self._Z[self._inputs] = np.eye(len(self._inputs))
            self._Z[self._states] = -inverse @ dynamics[:, self._inputs]
        free = np.zeros(cost.shape[0])
        free[self._states] = self._to_states @ instance.l[:equations]
        offset = limits @ free
        return (
            np.ascontiguousarray(self._Z.T @ cost @ self._Z),
            self._Z.T @ (cost @ free + instance.q),
            np.ascontiguousarray(limits @ self._Z),
            np.clip(instance.u[equations:] - offset, None, 1e30),
            np.clip(instance.l[equations:] - offset, -1e30, None),
            instance.matrices_changed,
        )

    def solve(self, prepared: Any) -> np.ndarray | None:
        H, f, A, high, low, changed = prepared
        if self._model is None:
            self._model = daqp.Model()
            self._model.setup(H, f, A, high, low)
        elif changed:
            self._model.update(H=H, f=f, A=A, bupper=high, blower=low)
        else:
            self._model.update(f=f, bupper=high, blower=low)
        x, _, flag, _ = self._model.solve()
        return np.array(x[:4]) if flag == 1 else None


class OneStep:
    """The controller's fallback: the law for one period inside the machine's limits, without looking ahead."""

    def __init__(self, structure: Structure) -> None:
        config = WalkerConfig()
        self._period_s = structure.setting.period_s
        self._scale = structure.setting.acceleration
        self._walker = Walker(config)
        self._machine, self._limits = MachineLimits(self._walker), MotionLimits(config)

    def prepare(self, instance: Instance) -> Any:
        return instance.instant

    def solve(self, prepared: Any) -> np.ndarray | None:
        instant = prepared
        terms = self._walker.evaluate(instant.height_m, instant.velocity)
        self._machine.linearise(terms)
        bounds = self._machine.bounds(terms, instant.wrench, np.ones(1))
        give_way = self._machine.give_way(terms, instant.wrench, bounds)
        force = instant.wrench @ terms.interface + instant.draw
        wanted = fallback_acceleration(instant.law, force, instant.velocity, self._period_s)
        allowed = within_machine(wanted, give_way, self._machine.rows, bounds)
        value = self._limits.clamp(allowed, instant.velocity, instant.previous, instant.height_m, self._period_s)
        return value / self._scale
