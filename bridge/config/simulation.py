"""`[simulation]`: the world when there is no robot."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class SimulationConfig(Section):
    """Who walks in which scenario, and the camera on the simulated walker."""

    scenario: Literal["walk", "push", "trip", "slip", "faint"] = "push"
    """What happens to the person."""

    person_height_m: float = Field(default=1.70, ge=1.50, le=1.95)
    """Height of the person [m]."""

    person_mass_kg: float = Field(default=75.0, ge=45, le=120)
    """Weight of the person [kg]."""

    walking_speed_m_s: float = Field(default=0.6, ge=0.0, le=1.2)
    """Speed the person wants [m/s]."""

    clip: str = ""
    """Motion capture, FILE.npz:NAME, that drives the person until the disturbance or its end; none if empty."""

    clip_from_s: float = Field(default=0.0, ge=0, le=3600)
    """Where in the clip to begin [s]."""

    begins: Literal["at_once", "armed"] = "at_once"
    """Whether the scenario begins with the process, or once the walker follows; the person stands until then."""

    event_s: float = Field(default=8.0, ge=3.0, le=3600)
    """When the disturbance comes, after the beginning [s]."""

    push_impulse_n_s: float = Field(default=110.0, ge=0, le=200)
    """Impulse of the push [N s]; 13.7 to 59.3 N s were recorded on healthy people who did not fall (human-data.csv)."""

    push_direction_deg: float = Field(default=0.0, ge=-360, le=360)
    """Direction of the push in the walker's axes: 0 from behind, 90 to the left, 180 from the front [degrees]."""

    harness_slack_m: float = Field(default=0.02, ge=0, le=0.20)
    """How far the pelvis may come down before the straps bear [m]."""

    seed: int = Field(default=0, ge=0)
    """Of everything that is drawn: noise of camera and force sensor."""

    rate_hz: float = Field(default=100.0, ge=20, le=250)
    """Rate of the loop, of odometry and wrench [Hz]."""

    camera_position_m: tuple[float, float, float] = (1.30, 0.0, 1.10)
    """Where the camera is in the walker's base frame: forward, left, up [m]."""

    camera_look_at_m: tuple[float, float, float] = (0.0, 0.0, 0.80)
    """The point of the base frame it looks at [m]."""

    camera_field_of_view_deg: float = Field(default=78.0, ge=20, le=150)
    """Horizontal field of view [degrees]."""

    camera_width_px: int = Field(default=320, ge=32, le=4096)
    """Image width [px]."""

    camera_height_px: int = Field(default=320, ge=32, le=4096)
    """Image height [px]."""

    camera_rate_hz: float = Field(default=30.0, ge=5, le=120)
    """Frame rate [Hz]."""

    camera_latency_s: float = Field(default=0.020, ge=0, le=0.5)
    """From exposure to the detector's answer on the wire [s]."""

    @model_validator(mode="after")
    def _looks_somewhere(self) -> Self:
        if self.camera_position_m[:2] == self.camera_look_at_m[:2]:
            raise ValueError(
                f"camera_look_at_m = {self.camera_look_at_m}: must not lie straight above or below camera_position_m"
            )
        return self
