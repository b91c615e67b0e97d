"""What becomes of a scenario when nobody helps: the harness is not worn. It decides whether a scenario is a fall."""

from __future__ import annotations

from typing import NamedTuple

from simulation.person.person import CONTROL_S, GRAVITY
from simulation.scenarios.scenario import Performance, Scenario

SEATED = 0.3  # share of the weight that a chair carries when somebody sits on its edge, feet on the floor
DESCENT_M_S = 0.15  # downward speed of the pelvis that is a descent
REST = (0.0, 0.0, 0.0, 0.0)


class Course(NamedTuple):
    """How it went without help; times from the first disturbance, NaN where there was none."""

    fell: bool
    descent_s: float  # when the pelvis began to come down for good [s]
    impact_s: float  # when pelvis, trunk, head, thigh or knee met the floor [s]
    impact_speed_m_s: float  # downward speed of the pelvis just before


def unassisted(scenario: Scenario) -> Course:
    """Perform `scenario` without harness; what falls before anything happens is a fall, and so is missing a chair."""
    performance = Performance(scenario, worn=False)
    world = performance.world
    nothing = float("nan")
    descent = nothing
    speed = 0.0
    for _ in range(round(scenario.duration_s / CONTROL_S)):
        performance.advance(REST)
        vertical = float(world.pelvis_velocity_m_s[2])
        if vertical > -DESCENT_M_S:
            descent = world.time_s
        if world.touched_down():
            began = performance.disturbed_s
            if began is None:
                return Course(True, nothing, nothing, speed)
            return Course(True, descent - began, world.time_s - began, speed)
        speed = -vertical
    missed = scenario.seat is not None and world.seat_force_n() < SEATED * GRAVITY * scenario.size.mass_kg
    return Course(world.person.fallen or missed, nothing, nothing, nothing)
