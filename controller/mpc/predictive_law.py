"""The model predictive admittance law: model, limits and predicted wrench in, plan or failure out."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import Floats
from controller.admittance import Admittance
from controller.machine_limits import MachineLimits
from controller.motion_limits import MotionLimits
from controller.mpc import solvers
from controller.mpc.assembly import Assembly, Instant
from controller.mpc.plan import Failure, Plan
from controller.mpc.problem import Problem
from controller.mpc.structure import Setting, Structure, build
from controller.walker import Walker


class PredictiveLaw:
    """Assembles and solves the problem of each control step.

    Args:
        walker: the model.
        admittance: the law (for the rendered mass).
        config: horizon, weights, solver.
        period_s: control period, for which the first acceleration is applied [s].

    Attributes:
        structure: the problem's structure.
        last_problem: what was solved last; its arrays change with the next step.

    Raises:
        MissingExtraError: the solver's package is not installed.
    """

    def __init__(self, walker: Walker, admittance: Admittance, config: MpcConfig, period_s: float) -> None:
        self.structure = structure_of(walker.config, tuple(admittance.mass.tolist()), config, period_s)
        self._assembly = Assembly(self.structure, config.compile_c)
        self._solver = solvers.create(self.structure, config)

    def reset(self) -> None:
        """Forget the warm start."""
        self._solver.forget()

    @property
    def tip_limits(self) -> tuple[Floats, Floats]:
        """Rows (4, 4) and limits (4,) of tip-over at the last instant: `rows @ a <= limits`; the law's own arrays."""
        return self._assembly.tip_rows, self._assembly.tip_high

    def problem(self, instant: Instant) -> Problem:
        """Return the problem of this instant."""
        return self._assembly.fill(instant)

    def plan(self, instant: Instant) -> Plan | Failure:
        """Solve the problem of this instant."""
        self.last_problem = self._assembly.fill(instant)
        flaw = self._assembly.flaw()
        if flaw:
            # The solver misses this problem, so what it was last given is no start for the next.
            self._solver.forget()
            return Failure(flaw, status="")
        return self._solver.solve(self.last_problem)


@lru_cache(maxsize=8)
def structure_of(walker: WalkerConfig, mass: tuple[float, ...], config: MpcConfig, period_s: float) -> Structure:
    """Return the structure of a configuration; it holds no state, so controllers of one configuration share it."""
    motion, model = MotionLimits(walker), Walker(walker)
    setting = Setting(
        stages=config.stages,
        stage_s=config.stage_s,
        period_s=period_s,
        acceleration=motion.acceleration,
        velocity=motion.velocity,
        jerk=motion.jerk,
        wheel_speed=model.wheel_jacobian / walker.wheel_speed_max_rad_s,
        mass=np.array(mass),
        increment_weight=config.increment_weight,
        fading=fading(config),
        stroke_m=(walker.column_low_m, walker.column_high_m),
    )
    return build(setting, model, MachineLimits(model))


def remaining(config: MpcConfig, age_s: float) -> float:
    """Return the part of a wrench that is expected to be left `age_s` after it was measured."""
    return 1.0 if config.wrench == "held" else math.exp(-age_s / config.wrench_decay_s)


def fading(config: MpcConfig) -> Floats:
    """Return the (N,) part of the present wrench that is expected at each stage."""
    return np.array([remaining(config, k * config.stage_s) for k in range(config.stages)])
