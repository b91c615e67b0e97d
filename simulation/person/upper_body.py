"""Back and arms: they keep their posture, swing against the legs, and reach."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from bridge.messages import Floats
from simulation.person.anthropometry import BodySize
from simulation.person.body import UPPER_JOINTS
from simulation.person.posture import HIP_SHARE
from simulation.person.reflexes import Reflexes


class UpperBody:
    """The joints above the hips; `dof`, `q` and `motor` are their indices in the model, (9,)."""

    REST: Final = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.1, -0.1, -0.3, -0.3])  # as UPPER_JOINTS [rad]

    def __init__(self, model: Any, data: Any, size: BodySize, reflexes: Reflexes) -> None:
        self._data, self._size, self._swing_rad = data, size, reflexes.arm_swing_rad
        g = reflexes
        self._kp = np.array([600.0, 600.0, g.back_yaw_nm_rad, *[g.arm_nm_rad] * 2, 20.0, 20.0, 10.0, 10.0])
        self._kd = np.array([40.0, 40.0, 15.0, *[g.arm_nms_rad] * 2, 2.0, 2.0, 1.0, 1.0])
        self.dof = np.array([model.joint(name).dofadr[0] for name in UPPER_JOINTS])
        self.q = np.array([model.joint(name).qposadr[0] for name in UPPER_JOINTS])
        self.motor = np.array([model.actuator(name).id for name in UPPER_JOINTS])

    def torque(self, pitch_rad: float, reach_rad: float, apart_m: float, speed_m_s: float) -> Floats:
        """Return the torques (9,) [N m].

        Args:
            pitch_rad: forward bend; the back takes its share of it.
            reach_rad: arms lifted forward.
            apart_m: left foot ahead of the right one.
            speed_m_s: of walking: who stands does not swing the arms.
        """
        swing = self._swing_rad * min(abs(speed_m_s), 1.0) * min(max(apart_m / 0.5, -1.0), 1.0)
        wanted = self.REST.copy()
        wanted[0] = (1.0 - HIP_SHARE) * pitch_rad
        wanted[3] += swing - reach_rad
        wanted[4] -= swing + reach_rad
        data = self._data
        gain = self._kp * (wanted - data.qpos[self.q]) - self._kd * data.qvel[self.dof]
        torque: Floats = self._size.strength * gain + data.qfrc_bias[self.dof]
        return torque
