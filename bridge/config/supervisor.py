"""`[supervisor]`: when the states of the intervention change."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class SupervisorConfig(Section):
    """Hysteresis and dwell of DISARMED -> FOLLOW <-> GUARD -> ARREST -> RECOVER -> FOLLOW, and of SAFE_STOP."""

    guard_on: float = Field(default=0.25, gt=0, le=1)
    """Largest risk over the horizon from which FOLLOW becomes GUARD."""

    guard_off: float = Field(default=0.10, ge=0, lt=1)
    """Largest risk over the horizon below which GUARD becomes FOLLOW again."""

    guard_dwell_s: float = Field(default=0.05, ge=0, le=1)
    """How long the risk must be there before GUARD [s]; one frame of the camera is not enough."""

    calm_dwell_s: float = Field(default=0.5, ge=0, le=10)
    """How long the risk must be gone before FOLLOW [s]."""

    arrest_on: float = Field(default=0.8, gt=0, le=1)
    """Risk within `arrest_reach_s` from which a fall is arrested."""

    arrest_off: float = Field(default=0.3, ge=0, lt=1)
    """Risk within `arrest_reach_s` below which an arrest may end."""

    arrest_reach_s: float = Field(default=0.1, ge=0, le=0.5)
    """How far ahead a risk counts for ARREST [s]; what lies further stiffens the prediction alone."""

    arrest_dwell_s: float = Field(default=0.05, ge=0, le=1)
    """How long that risk must be there before ARREST [s]; meanwhile the stiffening follows the risk already."""

    arrest_hold_s: float = Field(default=1.0, ge=0, le=30)
    """How long risk, load and descent must all be low before ARREST ends [s]."""

    harness_load_arrest_n: float = Field(default=370.0, gt=0, le=5000)
    """Downward pull at the interface that is a fall, whatever vision says [N]; half the weight of 75 kg."""

    harness_load_release_n: float = Field(default=150.0, ge=0, le=5000)
    """Downward pull below which an arrest may end [N]."""

    descent_arrest_m_s: float = Field(default=0.30, gt=0, le=5)
    """Downward speed of the support column that is a fall, whatever vision says [m/s]."""

    descent_release_m_s: float = Field(default=0.05, ge=0, le=5)
    """Downward speed below which an arrest may end [m/s]."""

    trigger_dwell_s: float = Field(default=0.02, ge=0, le=1)
    """How long load or descent must be there before ARREST [s]; an impact of one sample is not a fall."""

    recover_s: float = Field(default=1.5, ge=0, le=60)
    """Shortest time in RECOVER [s]."""

    recover_per_s: float = Field(default=0.5, gt=0, le=10)
    """Fall of the stiffening in RECOVER [1/s]; 0.5 goes from stiff to free in 2 s."""

    horizon_age_limit_s: float = Field(default=0.150, gt=0, le=0.190)
    """SAFE_STOP when the last good horizon is older [s]; with one loop period on top it must stay under 200 ms."""

    wrench_age_limit_s: float = Field(default=0.060, gt=0, le=0.090)
    """SAFE_STOP when the last good wrench is older [s]; with one loop period on top it must stay under 100 ms."""

    odometry_age_limit_s: float = Field(default=0.060, gt=0, le=0.090)
    """SAFE_STOP when the last good odometry is older [s]; with one loop period on top it must stay under 100 ms."""

    arm_dwell_s: float = Field(default=0.3, ge=0, le=60)
    """How long all inputs must have been good before DISARMED becomes FOLLOW [s]."""

    rearm_dwell_s: float = Field(default=0.5, ge=0, le=60)
    """How long all inputs must have been good before SAFE_STOP becomes RECOVER [s]."""

    auto_rearm: bool = True
    """Leave SAFE_STOP without a person's help; if false, SAFE_STOP lasts until the controller is restarted."""

    @model_validator(mode="after")
    def _hysteresis(self) -> Self:
        for off, on in (
            ("guard_off", "guard_on"),
            ("arrest_off", "arrest_on"),
            ("harness_load_release_n", "harness_load_arrest_n"),
            ("descent_release_m_s", "descent_arrest_m_s"),
        ):
            if getattr(self, off) >= getattr(self, on):
                raise ValueError(f"{off} = {getattr(self, off):g} must be below {on} = {getattr(self, on):g}")
        return self
