"""That the limits of walker, gate and supervisor fit together."""

from __future__ import annotations

from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError


def check_limits(config: SurefootConfig) -> None:
    """Refuse a configuration in which the gate would refuse or bend what the controller may do.

    Raises:
        ConfigError: names both keys and both values.
    """
    walker, gate = config.walker, config.gate
    at_most = (
        ("velocity_forward_max_m_s", "speed_m_s"),
        ("velocity_left_max_m_s", "speed_m_s"),
        ("velocity_yaw_max_rad_s", "yaw_rate_rad_s"),
        ("column_speed_max_m_s", "column_speed_m_s"),
        ("acceleration_forward_max_m_s2", "acceleration_m_s2"),
        ("acceleration_left_max_m_s2", "acceleration_m_s2"),
        ("acceleration_yaw_max_rad_s2", "yaw_acceleration_rad_s2"),
        ("column_acceleration_max_m_s2", "column_acceleration_m_s2"),
        ("jerk_forward_max_m_s3", "jerk_m_s3"),
        ("jerk_left_max_m_s3", "jerk_m_s3"),
        ("jerk_yaw_max_rad_s3", "yaw_jerk_rad_s3"),
        ("column_jerk_max_m_s3", "column_jerk_m_s3"),
        ("column_high_m", "column_high_m"),
    )
    for walker_key, gate_key in at_most:
        asked, allowed = getattr(walker, walker_key), getattr(gate, gate_key)
        if asked > allowed:
            raise ConfigError(f"walker.{walker_key} = {asked:g} is above gate.{gate_key} = {allowed:g}")
    if walker.column_low_m < gate.column_low_m:
        raise ConfigError(
            f"walker.column_low_m = {walker.column_low_m:g} is below gate.column_low_m = {gate.column_low_m:g}"
        )
