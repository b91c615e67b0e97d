"""What the simulated walker and harness are made of.

On purpose not what the controller believes of them (`[walker]`): heavier, with less friction, slower motors and a
force/torque sensor that errs. All values are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WalkerParameters:
    """The plant: mass, wheels, motors, column, sensor."""

    chassis_mass_kg: float = 88.0  # the controller believes 80 with its wheels
    chassis_com_m: tuple[float, float, float] = (0.02, -0.01, 0.28)
    chassis_inertia_kg_m2: tuple[float, float, float] = (4.9, 7.0, 8.6)
    carriage_mass_kg: float = 22.0
    wheelbase_m: float = 0.80
    track_m: float = 0.62
    wheel_radius_m: float = 0.0635
    wheel_inertia_kg_m2: float = 0.013  # of wheel and reflected rotor
    friction: float = 0.55  # of the rollers
    slip_damping_ns_m: float = 1200.0  # traction per slip speed of a wheel, before friction ends it
    rolling_resistance_n: float = 2.5  # of each wheel along its driving direction
    wheel_speed_max_rad_s: float = 26.0
    wheel_torque_max_nm: float = 14.0
    wheel_gain_nms_rad: float = 6.0  # of the wheels' speed loop
    wheel_integral_nm_rad: float = 25.0
    motor_lag_s: float = 0.020  # from wanted to delivered torque
    command_delay_s: float = 0.010  # from the wire to the motors
    column_low_m: float = 0.70
    column_high_m: float = 1.20
    column_force_max_n: float = 3500.0
    column_speed_max_m_s: float = 0.42
    column_stiffness_n_m: float = 100000.0  # of its position servo
    column_damping_ns_m: float = 4000.0
    force_noise_n: float = 2.0  # standard deviation of a sample
    force_bias_n: float = 3.0  # standard deviation of the sensor's offset, drawn once
    torque_noise_nm: float = 0.3


@dataclass(frozen=True, slots=True)
class HarnessParameters:
    """Straps between the interface and the person's pelvis: nothing within the slack, springs beyond it."""

    slack_horizontal_m: float = 0.03
    slack_down_m: float = 0.02
    slack_yaw_rad: float = 0.10
    stiffness_horizontal_n_m: float = 6000.0
    stiffness_down_n_m: float = 40000.0
    stiffness_yaw_nm_rad: float = 120.0
    damping_horizontal_ns_m: float = 150.0
    damping_down_ns_m: float = 900.0
    damping_yaw_nms_rad: float = 4.0
