"""A gate with small round limits, and ways to run it."""

from __future__ import annotations

from typing import Any

import numpy as np
from controller_messages import MS, NS, command

from bridge.messages import SupportCommand
from controller.gate import GateLimits, Held, SafetyGate

LIMITS = GateLimits(
    speed_m_s=1.0,
    acceleration_m_s2=2.0,
    jerk_m_s3=40.0,
    yaw_rate_rad_s=1.5,
    yaw_acceleration_rad_s2=4.0,
    yaw_jerk_rad_s3=80.0,
    column_speed_m_s=0.4,
    column_acceleration_m_s2=4.0,
    column_jerk_m_s3=160.0,
    column_low_m=0.5,
    column_high_m=1.5,
    lifetime_s=0.06,
    future_tolerance_s=0.05,
    excess_fraction=0.1,
    frame_age_s=0.25,
)
HELD = Held((800.0, 800.0, 80.0, 4000.0), (3000.0, 3000.0, 250.0, 31500.0))
PERIOD_NS = 10 * MS
HANDED_THROUGH = (
    *("stiffening", "state", "solver", "lifetime_s", "sequence", "reason", "valid", "frame_id"),
    *("rests_on_ns", "fall_distance", "fall_probability", "solve_time_s"),
)


def make_gate(**changes: Any) -> SafetyGate:
    options: dict[str, Any] = {"column_height_m": 1.0, "ordered": True, "held": HELD} | changes
    return SafetyGate(LIMITS, **options)


def run(gate: SafetyGate, velocity: Any, start_ns: int, periods: int, **changes: Any) -> list[SupportCommand]:
    """Give the gate the same wish `periods` times, each with its own stamp and number."""
    out = []
    for k in range(periods):
        now_ns = start_ns + k * PERIOD_NS
        asked = command(now_ns, velocity=np.array(velocity, dtype=float), sequence=now_ns // PERIOD_NS, **changes)
        out.append(gate.filter(asked, now_ns))
    return out


def moving(periods: int = 100, velocity: Any = (0.8, -0.5, 1.0, 0.0), **options: Any) -> tuple[SafetyGate, int]:
    """Return a gate in full motion and the time of its next call."""
    gate = make_gate(**options)
    run(gate, velocity, NS, periods)
    return gate, NS + periods * PERIOD_NS
