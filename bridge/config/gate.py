"""`[gate]`: the limits of the safety gate, on the controller's side and again on the drive's."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class GateConfig(Section):
    """What no command may exceed, whoever made it. Independent of `[walker]` on purpose; keep them at or above it."""

    speed_m_s: float = Field(default=1.2, gt=0, le=5)
    """Largest forward and sideward velocity [m/s]."""

    acceleration_m_s2: float = Field(default=2.0, gt=0, le=20)
    """Largest forward and sideward acceleration, and the one the base brakes with [m/s^2]."""

    jerk_m_s3: float = Field(default=40.0, gt=0, le=1000)
    """Largest forward and sideward jerk [m/s^3]."""

    yaw_rate_rad_s: float = Field(default=1.5, gt=0, le=10)
    """Largest yaw rate [rad/s]."""

    yaw_acceleration_rad_s2: float = Field(default=4.0, gt=0, le=50)
    """Largest yaw acceleration [rad/s^2]."""

    yaw_jerk_rad_s3: float = Field(default=80.0, gt=0, le=2000)
    """Largest yaw jerk [rad/s^3]."""

    column_speed_m_s: float = Field(default=0.4, gt=0, le=3)
    """Largest speed of the support column [m/s]."""

    column_acceleration_m_s2: float = Field(default=4.0, gt=0, le=50)
    """Largest acceleration of the support column [m/s^2]."""

    column_jerk_m_s3: float = Field(default=160.0, gt=0, le=5000)
    """Largest jerk of the support column [m/s^3]."""

    column_low_m: float = Field(default=0.70, ge=0, le=3)
    """Lowest column height [m]."""

    column_high_m: float = Field(default=1.20, gt=0, le=3)
    """Highest column height [m]."""

    lifetime_s: float = Field(default=0.060, gt=0, le=0.090)
    """Longest life of a command, whatever it says of itself [s]."""

    future_tolerance_s: float = Field(default=0.050, ge=0, le=0.5)
    """How far ahead of the reader's clock a command may be stamped [s]."""

    frame_age_s: float = Field(default=0.25, gt=0, le=1)
    """Oldest camera frame that a command may rest on [s]; a command that names no frame is not judged by it."""

    excess_fraction: float = Field(default=0.1, ge=0, le=1)
    """A value beyond its limit by up to this fraction is clipped; beyond that the command is refused."""

    @model_validator(mode="after")
    def _stroke(self) -> Self:
        if self.column_low_m >= self.column_high_m:
            raise ValueError(
                f"column_low_m = {self.column_low_m:g} must be below column_high_m = {self.column_high_m:g}"
            )
        return self
