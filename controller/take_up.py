"""Taking up the slack of the harness while the support is stiffened.

What is slack in a harness is height that a person falls before anything holds them: 2 cm are 0.6 m/s to be stopped. A
column that was lifted until the straps just bear stops what has not begun to move.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from bridge.config.admittance import AdmittanceConfig
from bridge.messages import Floats

_LONGEST_STEP_S: Final = 0.1  # within which an emptying tank must still be able to pay


class Lift(NamedTuple):
    """Of each stage (N,)."""

    force_n: Floats
    speed_m_s: Floats  # of the column under that force alone


class TakeUp:
    """How the column is lifted: `F = D v_up`, so that it moves at `v_up` where nothing else pulls."""

    def __init__(self, config: AdmittanceConfig, stage_s: float) -> None:
        self._force_n = config.take_up_force_n
        self._speed_m_s = config.take_up_speed_m_s
        self._reach_m = config.take_up_reach_m
        self._stage_s = stage_s

    def lift(self, profile: Floats, damping: Floats, load_n: float, raised_m: float, energy_j: float) -> Lift:
        """Return the lift of each stage; none where the straps bear, beyond the reach, or with an empty tank.

        Args:
            profile: (N,) stiffening.
            damping: (N,) of the column [N s/m].
            load_n: downward pull of the person now [N].
            raised_m: how far the column was lifted already [m].
            energy_j: what the tank holds [J].
        """
        wanted_n = self._force_n * profile
        slack = np.maximum(wanted_n - max(load_n, 0.0), 0.0)
        share = np.divide(slack, wanted_n, out=np.zeros_like(slack), where=wanted_n > 0.0)
        speed = self._speed_m_s * profile * share
        # Lifting gives most beyond what the damper takes at half the speed: D v_up^2 / 4.
        cost_j = 0.25 * float(damping[0]) * float(speed[0]) ** 2 * _LONGEST_STEP_S
        if energy_j < cost_j:
            speed *= energy_j / cost_j
        risen_m = raised_m + self._stage_s * (np.cumsum(speed) - speed)
        speed[risen_m >= self._reach_m] = 0.0
        return Lift(damping * speed, speed)
