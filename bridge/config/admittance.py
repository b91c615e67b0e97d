"""`[admittance]`: the mass, damper and spring that the person feels at the interface, free and in an arrest."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class AdmittanceConfig(Section):
    """Rendered admittance `M a + D(s) v + K_hold (p - p_hold) + K(s) (p - p_a) = f` along x, y, yaw and height.

    `D(s) = D_free + s (D_arrest - D_free)` and `K(s) = s^2 K_arrest`: with the square, the damping ratio does not
    dip while both rise. Horizontal stiffness is one number on purpose: an isotropic spring stores the same energy
    whatever the heading. All values are assumed.
    """

    mass_horizontal_kg: float = Field(default=40.0, ge=5, le=500)
    """Rendered mass forward and sideward [kg]; lighter than the walker, heavier than what its drives make unstable."""

    inertia_yaw_kg_m2: float = Field(default=4.0, ge=0.5, le=100)
    """Rendered inertia about the vertical [kg m^2]."""

    mass_height_kg: float = Field(default=40.0, ge=5, le=500)
    """Rendered mass of the column [kg]."""

    damping_free_forward_ns_m: float = Field(default=30.0, ge=1, le=1000)
    """Forward damping in free walking: 24 N keep 0.8 m/s [N s/m]."""

    damping_free_left_ns_m: float = Field(default=60.0, ge=1, le=1000)
    """Sideward damping in free walking [N s/m]."""

    damping_free_yaw_nms_rad: float = Field(default=8.0, ge=0.1, le=500)
    """Damping about the vertical in free walking [N m s/rad]."""

    damping_free_height_ns_m: float = Field(default=800.0, ge=1, le=20000)
    """Damping of the column in free walking: it drifts after the person and does not dance with each step [N s/m]."""

    damping_arrest_horizontal_ns_m: float = Field(default=800.0, ge=1, le=20000)
    """Forward and sideward damping in an arrest [N s/m]; 1.15 times critical with the defaults."""

    damping_arrest_yaw_nms_rad: float = Field(default=80.0, ge=0.1, le=5000)
    """Damping about the vertical in an arrest [N m s/rad]."""

    damping_arrest_height_ns_m: float = Field(default=6000.0, ge=1, le=100000)
    """Damping of the column in an arrest: 1.2 times critical with 100 kg hanging on it [N s/m]."""

    stiffness_arrest_horizontal_n_m: float = Field(default=3000.0, ge=0, le=100000)
    """Forward and sideward stiffness in an arrest [N/m]: 150 N of stumbling push give 5 cm."""

    stiffness_arrest_yaw_nm_rad: float = Field(default=250.0, ge=0, le=10000)
    """Stiffness about the vertical in an arrest [N m/rad]."""

    stiffness_arrest_height_n_m: float = Field(default=60000.0, ge=0, le=500000)
    """Stiffness of the column in an arrest [N/m]: 100 kg hanging give 1.6 cm, leaving 8.4 of 10 for the catch."""

    stiffness_hold_height_n_m: float = Field(default=1500.0, ge=0, le=50000)
    """Stiffness that always holds the column near `height_hold_m` [N/m]: 30 N of leaning give 2 cm."""

    height_hold_m: float = Field(default=1.0, gt=0, le=3)
    """Height of the interface above the floor in free walking [m]; must lie within the column's stroke."""

    take_up_force_n: float = Field(default=120.0, ge=0, le=1000)
    """Pull up to which a fully stiffened column rises to take up the harness's slack [N]; 0 leaves the slack."""

    take_up_speed_m_s: float = Field(default=0.35, gt=0, le=1)
    """Speed at which it rises, fully stiffened and without load [m/s]."""

    take_up_reach_m: float = Field(default=0.06, ge=0, le=0.3)
    """Highest that it rises above where stiffening began [m]."""

    spring_reach_horizontal_m: float = Field(default=0.15, gt=0, le=2)
    """How far the horizontal spring stretches before its anchor slips along [m]: bounds the pull on who walks on."""

    spring_reach_yaw_rad: float = Field(default=0.4, gt=0, le=3)
    """How far the yaw spring turns before its anchor slips along [rad]."""

    tank_initial_j: float = Field(default=15.0, ge=0, le=1000)
    """Energy in the tank at the start [J]: what stiffening may inject before anything was dissipated."""

    tank_capacity_j: float = Field(default=40.0, gt=0, le=1000)
    """Most energy the tank holds [J]: bounds what stiffening can ever inject at once."""

    tank_refill_fraction: float = Field(default=0.5, ge=0, le=1)
    """Part of the energy dissipated by the damper that refills the tank."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        ordered = (
            ("damping_free_forward_ns_m", "damping_arrest_horizontal_ns_m"),
            ("damping_free_left_ns_m", "damping_arrest_horizontal_ns_m"),
            ("damping_free_yaw_nms_rad", "damping_arrest_yaw_nms_rad"),
            ("damping_free_height_ns_m", "damping_arrest_height_ns_m"),
            ("tank_initial_j", "tank_capacity_j"),
        )
        for low, high in ordered:
            if getattr(self, low) > getattr(self, high):
                raise ValueError(f"{low} = {getattr(self, low):g} must be at most {high} = {getattr(self, high):g}")
        return self

    @property
    def mass(self) -> tuple[float, float, float, float]:
        """Rendered mass along x, y [kg], yaw [kg m^2], height [kg]."""
        return (self.mass_horizontal_kg, self.mass_horizontal_kg, self.inertia_yaw_kg_m2, self.mass_height_kg)

    @property
    def damping_free(self) -> tuple[float, float, float, float]:
        """Damping at s = 0 along x, y [N s/m], yaw [N m s/rad], height [N s/m]."""
        return (
            self.damping_free_forward_ns_m,
            self.damping_free_left_ns_m,
            self.damping_free_yaw_nms_rad,
            self.damping_free_height_ns_m,
        )

    @property
    def damping_arrest(self) -> tuple[float, float, float, float]:
        """Damping at s = 1 along x, y [N s/m], yaw [N m s/rad], height [N s/m]."""
        return (
            self.damping_arrest_horizontal_ns_m,
            self.damping_arrest_horizontal_ns_m,
            self.damping_arrest_yaw_nms_rad,
            self.damping_arrest_height_ns_m,
        )

    @property
    def stiffness_stop(self) -> tuple[float, float, float, float]:
        """Stiffness that a stop holds with: the arrest's, and what always holds the column."""
        x, y, yaw, height = self.stiffness_arrest
        return (x, y, yaw, height + self.stiffness_hold_height_n_m)

    @property
    def stiffness_arrest(self) -> tuple[float, float, float, float]:
        """Stiffness at s = 1 along x, y [N/m], yaw [N m/rad], height [N/m]."""
        return (
            self.stiffness_arrest_horizontal_n_m,
            self.stiffness_arrest_horizontal_n_m,
            self.stiffness_arrest_yaw_nm_rad,
            self.stiffness_arrest_height_n_m,
        )
