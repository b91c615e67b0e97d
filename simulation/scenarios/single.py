"""The one scenario that `[simulation]` describes."""

from __future__ import annotations

from typing import Final

from bridge.config.simulation import SimulationConfig
from simulation.mocap.clip import load_clip
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.disturbance import Disturbance, Faint, Push, Slip, Trip
from simulation.scenarios.scenario import Scenario, Wish

START_S: Final = 1.5  # the person stands before walking off
AFTER_EVENT_S: Final = 6.0


def scenario_from(config: SimulationConfig) -> Scenario:
    """Return the scenario of `[simulation]`.

    Raises:
        SourceError: the motion-capture clip cannot be used.
    """
    happens: dict[str, tuple[Disturbance, ...]] = {
        "walk": (),
        "push": (Push(config.event_s, config.push_impulse_n_s, config.push_direction_deg),),
        "trip": (Trip(config.event_s),),
        "slip": (Slip(config.event_s),),
        "faint": (Faint(config.event_s),),
    }
    return Scenario(
        title=config.scenario,
        kind="non_fall" if config.scenario == "walk" else "fall",
        family=config.scenario,
        size=BodySize(config.person_height_m, config.person_mass_kg),
        wishes=(Wish(START_S, Intent(speed_m_s=config.walking_speed_m_s)),),
        disturbances=happens[config.scenario],
        duration_s=config.event_s + AFTER_EVENT_S,
        seed=config.seed,
        clip=load_clip(config.clip, config.clip_from_s, config.event_s) if config.clip else None,
    )
