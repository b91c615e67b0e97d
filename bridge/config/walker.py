"""`[walker]`: masses, sizes and limits of the walker.

WANDER's wheel diameter (0.127 m), width (0.7 m) and total mass (about 100 kg) are the only figures to go by
(Fortuna et al. 2024 publish no more); everything else is assumed, and marked so. Measure yours and write it here.
"""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class WalkerConfig(Section):
    """The walker: a planar base on four mecanum wheels, a vertical support column, the interface on the column's axis.

    The base frame lies on the floor midway between the wheels, x forward, y left. The column's axis goes through
    it; column height is the height of the interface (harness bar and force/torque sensor) above the floor.
    """

    chassis_mass_kg: float = Field(default=72.0, gt=0, le=500)
    """Mass of the frame with batteries and drives [kg]; assumed, so that the whole has about 100 kg."""

    chassis_length_m: float = Field(default=0.90, gt=0, le=3)
    """Length of the frame as a uniform box, for its inertia [m]; assumed."""

    chassis_width_m: float = Field(default=0.70, gt=0, le=3)
    """Overall width, also of the frame as a uniform box [m]; WANDER."""

    chassis_box_height_m: float = Field(default=0.50, gt=0, le=3)
    """Height of the frame as a uniform box, for its inertia [m]; assumed."""

    chassis_com_forward_m: float = Field(default=0.0, ge=-1, le=1)
    """Forward offset of the frame's centre of mass from the column's axis [m]; assumed."""

    chassis_com_height_m: float = Field(default=0.25, gt=0, le=2)
    """Height of the frame's centre of mass above the floor: batteries sit low [m]; assumed."""

    wheel_mass_kg: float = Field(default=2.0, gt=0, le=50)
    """Mass of one mecanum wheel [kg]; assumed."""

    wheel_radius_m: float = Field(default=0.0635, gt=0, le=0.5)
    """Radius of the wheels: half of WANDER's 0.127 m [m]."""

    wheel_width_m: float = Field(default=0.05, gt=0, le=0.5)
    """Width of a wheel, for its inertia [m]; assumed."""

    wheelbase_m: float = Field(default=0.80, gt=0, le=3)
    """Distance between front and rear wheel centres [m]; assumed."""

    track_m: float = Field(default=0.62, gt=0, le=3)
    """Distance between left and right wheel centres: the width less wheels and covers [m]; assumed."""

    wheel_rotor_inertia_kg_m2: float = Field(default=2e-5, ge=0, le=1)
    """Inertia of a wheel motor's rotor [kg m^2]; assumed."""

    wheel_gear_ratio: float = Field(default=20.0, gt=0, le=1000)
    """Motor turns per wheel turn; assumed."""

    carriage_mass_kg: float = Field(default=20.0, gt=0, le=200)
    """Mass that moves with the column: carriage, harness bar, sensor [kg]; assumed."""

    carriage_com_below_m: float = Field(default=0.05, ge=-1, le=1)
    """How far the carriage's centre of mass lies below the interface [m]; assumed."""

    carriage_width_m: float = Field(default=0.60, gt=0, le=3)
    """Width of the harness bar as a uniform rod across the walker, for its inertia [m]; assumed."""

    column_rotor_inertia_kg_m2: float = Field(default=5e-5, ge=0, le=1)
    """Inertia of the column motor's rotor with the screw [kg m^2]; assumed."""

    column_lead_m: float = Field(default=0.010, gt=0, le=1)
    """Travel of the column per motor turn [m]; assumed."""

    gravity_m_s2: float = Field(default=9.81, ge=0, le=20)
    """Gravity [m/s^2]."""

    wheel_speed_max_rad_s: float = Field(default=26.0, gt=0, le=500)
    """Largest wheel speed: 1.65 m/s straight ahead [rad/s]; assumed."""

    wheel_torque_max_nm: float = Field(default=14.0, gt=0, le=1000)
    """Largest torque at a wheel: 880 N for all four straight ahead [N m]; assumed."""

    friction_coefficient: float = Field(default=0.5, gt=0, le=2)
    """Friction of the rollers on the floor that may be used: rubber on indoor floors, with reserve; assumed."""

    velocity_forward_max_m_s: float = Field(default=1.2, gt=0, le=5)
    """Largest forward and backward velocity: comfortable walking of old people is 0.9-1.3 m/s [m/s]; assumed."""

    velocity_left_max_m_s: float = Field(default=0.6, gt=0, le=5)
    """Largest sideward velocity [m/s]; assumed."""

    velocity_yaw_max_rad_s: float = Field(default=1.2, gt=0, le=10)
    """Largest yaw rate [rad/s]; assumed."""

    acceleration_forward_max_m_s2: float = Field(default=2.0, gt=0, le=20)
    """Largest forward and backward acceleration [m/s^2]; assumed."""

    acceleration_left_max_m_s2: float = Field(default=2.0, gt=0, le=20)
    """Largest sideward acceleration [m/s^2]; assumed."""

    acceleration_yaw_max_rad_s2: float = Field(default=4.0, gt=0, le=50)
    """Largest yaw acceleration [rad/s^2]; assumed."""

    jerk_forward_max_m_s3: float = Field(default=40.0, gt=0, le=1000)
    """Largest forward and backward jerk: full acceleration in 50 ms [m/s^3]; assumed."""

    jerk_left_max_m_s3: float = Field(default=40.0, gt=0, le=1000)
    """Largest sideward jerk [m/s^3]; assumed."""

    jerk_yaw_max_rad_s3: float = Field(default=80.0, gt=0, le=2000)
    """Largest yaw jerk [rad/s^3]; assumed."""

    column_low_m: float = Field(default=0.70, gt=0, le=3)
    """Lowest height of the interface above the floor [m]; assumed."""

    column_high_m: float = Field(default=1.20, gt=0, le=3)
    """Highest height of the interface above the floor [m]; assumed."""

    column_speed_max_m_s: float = Field(default=0.4, gt=0, le=3)
    """Largest column speed [m/s]; assumed."""

    column_acceleration_max_m_s2: float = Field(default=4.0, gt=0, le=50)
    """Largest column acceleration [m/s^2]; assumed."""

    column_jerk_max_m_s3: float = Field(default=160.0, gt=0, le=5000)
    """Largest column jerk [m/s^3]; assumed."""

    column_force_max_n: float = Field(default=3500.0, gt=0, le=50000)
    """Largest force of the column: 100 kg caught at 2.1 m/s in 0.1 m pull 3.2 kN, the carriage weighs 0.2 kN [N]."""

    support_margin_m: float = Field(default=0.06, ge=0, le=1)
    """How far inside the wheels' rectangle the zero-moment point must stay [m]; assumed."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.column_low_m >= self.column_high_m:
            raise ValueError(
                f"column_low_m = {self.column_low_m:g} must be below column_high_m = {self.column_high_m:g}"
            )
        half = 0.5 * min(self.track_m, self.wheelbase_m)
        if self.support_margin_m >= half:
            raise ValueError(
                f"support_margin_m = {self.support_margin_m:g} must be below half the support rectangle = {half:g}"
            )
        return self

    @property
    def mass_kg(self) -> float:
        """Mass of the whole walker [kg]."""
        return self.chassis_mass_kg + 4 * self.wheel_mass_kg + self.carriage_mass_kg

    @property
    def velocity_max(self) -> tuple[float, float, float, float]:
        """Largest velocity along forward, left [m/s], yaw [rad/s], height [m/s]."""
        return (
            self.velocity_forward_max_m_s,
            self.velocity_left_max_m_s,
            self.velocity_yaw_max_rad_s,
            self.column_speed_max_m_s,
        )

    @property
    def acceleration_max(self) -> tuple[float, float, float, float]:
        """Largest acceleration along forward, left [m/s^2], yaw [rad/s^2], height [m/s^2]."""
        return (
            self.acceleration_forward_max_m_s2,
            self.acceleration_left_max_m_s2,
            self.acceleration_yaw_max_rad_s2,
            self.column_acceleration_max_m_s2,
        )

    @property
    def jerk_max(self) -> tuple[float, float, float, float]:
        """Largest jerk along forward, left [m/s^3], yaw [rad/s^3], height [m/s^3]."""
        return (
            self.jerk_forward_max_m_s3,
            self.jerk_left_max_m_s3,
            self.jerk_yaw_max_rad_s3,
            self.column_jerk_max_m_s3,
        )
