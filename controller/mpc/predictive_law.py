"""The model predictive admittance law: model, limits and predicted wrench in, plan or failure out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats
from controller.admittance import Admittance, AdmittanceStages
from controller.machine_limits import MachineBounds, MachineLimits
from controller.motion_limits import MotionLimits
from controller.mpc.assembly import Assembly
from controller.mpc.plan import Failure, Plan
from controller.mpc.problem import Problem
from controller.mpc.solver import OsqpSolver
from controller.mpc.structure import Setting, Structure, build
from controller.walker import Walker


class Instant(NamedTuple):
    """Everything one step of the MPC rests on."""

    law: AdmittanceStages
    force: (
        Floats  # (N, 4) predicted generalised force of the person, with what draws the command to the measured motion
    )
    velocity: Floats  # (4,) commanded
    previous: Floats  # (4,) acceleration applied until now
    height_m: float  # commanded
    bounds: MachineBounds
    give_way: Floats  # (4,)


class PredictiveLaw:
    """Assembles and solves the problem of each control step.

    Args:
        walker: the model (for what does not change: wheel Jacobian, limits).
        admittance: the law (for the rendered mass).
        machine: linear limits on the acceleration; its rows are read at every step.
        config: horizon, weights, solver.
        period_s: control period, for which the first acceleration is applied [s].

    Attributes:
        structure: the problem's structure.
        last_problem: what was solved last; its arrays change with the next step.
    """

    def __init__(
        self, walker: Walker, admittance: Admittance, machine: MachineLimits, config: MpcConfig, period_s: float
    ) -> None:
        motion = MotionLimits(walker.config)
        self._machine = machine
        self._config = config
        self.structure: Structure = build(
            Setting(
                stages=config.stages,
                stage_s=config.stage_s,
                period_s=period_s,
                acceleration=motion.acceleration,
                velocity=motion.velocity,
                jerk=motion.jerk,
                wheel_speed=walker.wheel_jacobian / walker.config.wheel_speed_max_rad_s,
                mass=admittance.mass,
                increment_weight=config.increment_weight,
            )
        )
        self._stroke_m = (walker.config.column_low_m, walker.config.column_high_m)
        self._assembly = Assembly(self.structure, machine.rows, self._stroke_m)
        self._solver = OsqpSolver(self.structure, config)

    def reset(self) -> None:
        """Forget the warm start."""
        self._solver.forget()

    def problem(self, instant: Instant) -> Problem:
        """Return the problem of this instant."""
        law, force, velocity, previous, height_m, bounds, give_way = instant
        return self._assembly.fill(law, force, velocity, previous, height_m, self._machine.rows, bounds, give_way)

    def plan(self, instant: Instant) -> Plan | Failure:
        """Solve the problem of this instant."""
        self.last_problem = self.problem(instant)
        return self._solver.solve(self.last_problem)


def remaining(config: MpcConfig, age_s: float) -> float:
    """Return the part of a wrench that is expected to be left `age_s` after it was measured."""
    return 1.0 if config.wrench == "held" else math.exp(-age_s / config.wrench_decay_s)


def fading(config: MpcConfig) -> Floats:
    """Return the (N,) part of the present wrench that is expected at each stage."""
    return np.array([remaining(config, k * config.stage_s) for k in range(config.stages)])
