"""`[drive]`: the drive without a robot."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class DriveConfig(Section):
    """A base and a column that follow commands with first-order lag, and a scripted person pushing on them."""

    rate_hz: float = Field(default=100.0, ge=20, le=1000)
    """Rate of the loop, of the odometry and of the wrench [Hz]."""

    base_lag_s: float = Field(default=0.05, ge=0, le=1)
    """Time constant of the base's velocity [s]; assumed."""

    column_lag_s: float = Field(default=0.03, ge=0, le=1)
    """Time constant of the column's velocity [s]; assumed."""

    column_height_m: float = Field(default=1.0, gt=0, le=3)
    """Column height at the start [m]."""

    script: Literal["zero", "walk", "push", "fall"] = "walk"
    """What the person does to the walker: nothing, walk along, be pushed sideways, or fall into the harness."""

    walk_force_n: float = Field(default=24.0, ge=0, le=200)
    """Mean forward push of a walking person [N]; assumed: keeps 0.8 m/s against 30 N s/m of damping."""

    walk_lean_n: float = Field(default=30.0, ge=0, le=200)
    """Mean downward lean of a walking person [N]; assumed."""

    cadence_hz: float = Field(default=1.8, gt=0, le=5)
    """Steps per second; the forces sway with it [Hz]. Adults walk at about 1.8."""

    event_s: float = Field(default=8.0, ge=0, le=3600)
    """When the push or the fall begins, after the drive's start [s]."""

    push_force_n: float = Field(default=80.0, ge=-1000, le=1000)
    """Sideward push, positive to the left [N]."""

    push_s: float = Field(default=0.2, gt=0, le=5)
    """Duration of the push [s]."""

    fall_load_n: float = Field(default=600.0, ge=0, le=3000)
    """Downward pull of the fallen person in the harness [N]."""

    fall_rise_s: float = Field(default=0.3, gt=0, le=5)
    """Time in which that pull builds up [s]."""

    fall_hold_s: float = Field(default=3.0, ge=0, le=3600)
    """How long the person hangs in the harness before standing up again [s]."""

    @model_validator(mode="after")
    def _settles(self) -> Self:
        if self.cadence_hz * 4 > self.rate_hz:
            raise ValueError(
                f"cadence_hz = {self.cadence_hz:g} must be at most a quarter of rate_hz = {self.rate_hz:g}"
            )
        return self
