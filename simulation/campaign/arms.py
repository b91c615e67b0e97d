"""The three arms of a campaign: one controller, one wire, one world; a key of `[intervention]` tells them apart."""

from __future__ import annotations

from typing import Final

from bridge.config.surefoot import SurefootConfig
from bridge.messages import STEPS

STEPS_USED: Final = {
    "none": 0,  # follows whatever happens; neither harness load nor descent changes that
    "reactive": 1,  # the present step of the horizon, harness load, descent
    "anticipatory": STEPS,  # the whole horizon, harness load, descent
}
ARMS: Final = tuple(STEPS_USED)


def configured(config: SurefootConfig, arm: str, seed: int) -> SurefootConfig:
    """Return `config` for an arm, with the sensors' noise drawn from `seed`."""
    intervention = config.intervention.model_copy(update={"steps_used": STEPS_USED[arm]})
    simulation = config.simulation.model_copy(update={"seed": seed})
    return config.model_copy(update={"intervention": intervention, "simulation": simulation})
