"""Which networks judge simulated people where the configuration names none.

The shipped ones learnt from films of people who fall freely; what is a fall to them is lying. Those named 'simulated'
have also seen simulated people caught by a harness (their card: anticipation/weights/SIMULATED.md). Campaigns use
these; the demo runs as shipped.
"""

from __future__ import annotations

from typing import Final

from bridge.config.surefoot import SurefootConfig

SIMULATED: Final = "simulated"


def for_simulated_people(config: SurefootConfig) -> SurefootConfig:
    """Return `config` with the networks for simulated people, unless it names others."""
    if config.anticipation.checkpoint:
        return config
    anticipation = config.anticipation.model_copy(update={"checkpoint": SIMULATED})
    return config.model_copy(update={"anticipation": anticipation})
