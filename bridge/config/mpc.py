"""`[mpc]`: horizon, weights and solver settings of the model predictive admittance controller."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bridge.config.section import Section


class MpcConfig(Section):
    """The receding-horizon problem and the bounds on solving it."""

    stages: int = Field(default=20, ge=2, le=50)
    """Stages of the horizon; with `stage_s` the anticipation's own reach."""

    stage_s: float = Field(default=0.025, gt=0, le=0.2)
    """Length of a stage [s]."""

    wrench: Literal["held", "decaying"] = "decaying"
    """What is assumed of the person's wrench over the horizon: that it stays, or that it fades exponentially."""

    wrench_decay_s: float = Field(default=0.5, gt=0, le=10)
    """Time constant with which a decaying wrench fades [s]; a push lasts a few tenths of a second."""

    increment_weight: float = Field(default=0.01, ge=0, le=10)
    """Weight of a change of acceleration between stages against the admittance's error, both as accelerations."""

    solver: Literal["osqp", "daqp", "piqp"] = "daqp"
    """QP solver: `daqp` (exact, fastest here), `osqp` (also exported as C by `surefoot codegen`), `piqp`."""

    compile_c: bool = True
    """Build the problem's functions as C, once into a cache, where there is a C compiler; else they are interpreted."""

    max_iterations: int = Field(default=600, ge=1, le=20000)
    """Most iterations of the solver for one step; `daqp` needs a dozen at worst, `piqp` twenty, `osqp` some hundred."""

    time_limit_s: float = Field(default=0.008, gt=0, le=0.1)
    """Most time of the solver for one step, on the wall clock [s]; keep it below the control period."""

    step_size: float = Field(default=2.0, gt=1e-6, le=1e6)
    """Step size rho of `osqp`'s ADMM; tuned on the benchmark for the problem's own scaling."""

    accuracy: float = Field(default=1e-5, gt=0, le=1e-2)
    """Absolute and relative accuracy asked of `osqp` and `piqp`, in scaled units (1 = the machine's limit)."""

    residual_max: float = Field(default=1e-4, gt=0, le=1e-1)
    """Largest primal or dual residual, by our own count, with which a plan is accepted (scaled units)."""

    fallback_max_s: float = Field(default=0.2, ge=0, le=5)
    """How long the one-step law may stand in for the MPC before the base is stopped [s]."""

    tracking_tolerance_m_s: float = Field(default=0.25, gt=0, le=5)
    """How far the measured velocity may lag the commanded one before the command yields to it [m/s, rad/s]."""

    tracking_rate_per_s: float = Field(default=20.0, ge=0, le=200)
    """How fast the command yields to the measured velocity beyond the tolerance [1/s]."""

    pose_rate_per_s: float = Field(default=2.0, ge=0, le=50)
    """How fast the commanded pose is drawn to the measured one [1/s]."""
