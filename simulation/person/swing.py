"""One leg: where its joints are in the model, and how it swings to a foothold.

The foot follows a path of least jerk over the floor; the joints track it with stiffness, damping and a share of the
torque that the wanted acceleration takes (M q'' of the model), so that the leg is braked in time and lands softly.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin
from typing import Any, Final

import mujoco
import numpy as np

from bridge.messages import Floats
from simulation.person.anthropometry import BodySize
from simulation.person.body import LEG_JOINTS
from simulation.person.leg import leg_angles
from simulation.person.reflexes import Reflexes
from simulation.person.support import Sole

FASTEST_RAD_S: Final = 15.0
FASTER_RAD_S2: Final = 150.0
SMOOTH: Final = 0.25  # share of a new acceleration that is taken over in each turn
AHEAD: Final = 0.5  # share of the torque for the wanted acceleration that is given ahead
BENT: Final = 0.992  # longest swinging leg, of the stretched one: no knee locks in the air
LATE_M_S: Final = 1.0  # how fast a foot that should stand already is put down
LATE_MOST_M: Final = 0.08


class Leg:
    """A leg of the body in `model`.

    Attributes:
        dof, q, motor: indices of its six joints' velocities, positions and motors, (6,).
        foot: the foot's body.
        geom: the sole's geometry.
        hip: the hip joint in the pelvis frame, (3,) [m].
        swung: share of the present swing that is over, 0..1.
    """

    def __init__(
        self, model: Any, data: Any, side: str, sign: float, size: BodySize, reflexes: Reflexes, turn_s: float
    ) -> None:
        self._turn_s = turn_s
        self._model, self._data, self._size, self._reflexes = model, data, size, reflexes
        g, joints = reflexes, [f"{side}_{name}" for name in LEG_JOINTS]
        self.dof = np.array([model.joint(name).dofadr[0] for name in joints])
        self.q = np.array([model.joint(name).qposadr[0] for name in joints])
        self.motor = np.array([model.actuator(name).id for name in joints])
        self.foot = model.body(f"{side}_foot").id
        self.geom = model.geom(f"{side}_sole").id
        self.hip: Floats = np.array([0.0, sign * size.hip_half_width_m, 0.0])
        self._pelvis = model.body("pelvis").id
        self._hip_joint = np.array([model.joint(name).id for name in joints[:3]])
        self._torque = np.abs(model.actuator_ctrlrange[self.motor, 1])
        self._kp = np.array([g.swing_yaw_nm_rad, *[g.swing_hip_nm_rad] * 2, g.swing_knee_nm_rad, 80.0, 60.0])
        self._kd = np.array([g.swing_yaw_nms_rad, *[g.swing_hip_nms_rad] * 2, g.swing_knee_nms_rad, 3.0, 2.0])
        self._wanted, self._inertial = np.zeros(model.nv), np.zeros(model.nv)
        self._start = np.zeros(3)
        self._angles: Floats | None = None
        self._rate, self._acceleration = np.zeros(6), np.zeros(6)
        self.swung = 0.0

    def sole(self) -> Sole:
        """Return where the sole presses on the floor."""
        position, m = self._data.xpos[self.foot], self._data.xmat[self.foot]
        turn, forward = atan2(m[3], m[0]), self._size.sole_forward_m
        return Sole(
            float(position[0] + cos(turn) * forward), float(position[1] + sin(turn) * forward),
            0.42 * self._size.foot_m, 0.87 * self._size.sole_half_width_m,
        )  # fmt: skip

    def on_floor(self) -> bool:
        """Whether the sole touches anything."""
        contact = self._data.contact
        return bool(np.any(contact.geom1 == self.geom) or np.any(contact.geom2 == self.geom))

    def lift(self) -> None:
        """Begin a swing."""
        self._start = self._data.xpos[self.foot].copy()
        self._angles = None
        self._acceleration[:] = 0.0
        self.swung = 0.0

    def move(
        self, aim: tuple[float, float], heading: tuple[float, float], remaining_s: float, strength: float
    ) -> Floats:
        """Return the torques (6,) [N m], without those against gravity.

        Args:
            aim: where the ankle comes down, in the world [m].
            heading: cosine and sine of the foot's direction.
            remaining_s: until touchdown; negative when it is late.
            strength: share of the motors' torque that is there.
        """
        data, size, g = self._data, self._size, self._reflexes
        self.swung += (1.0 - self.swung) * min(self._turn_s / max(remaining_s, self._turn_s), 1.0)
        early = min(g.swing_early * self.swung, 1.0)
        way = early**3 * (10.0 - 15.0 * early + 6.0 * early**2)
        height = size.ankle_height_m + g.swing_lift_m * sin(pi * self.swung)
        height -= max(self.swung - 0.9, 0.0) * g.swing_down + min(LATE_M_S * max(-remaining_s, 0.0), LATE_MOST_M)
        ankle = np.array([
            (1 - way) * self._start[0] + way * aim[0], (1 - way) * self._start[1] + way * aim[1], height,
        ])  # fmt: skip
        c, s = heading
        rotation = data.xmat[self._pelvis].reshape(3, 3)
        flat = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        angles = leg_angles(
            rotation.T @ (ankle - data.xpos[self._pelvis]),
            rotation.T @ flat,
            self.hip,
            size.thigh_m,
            size.shank_m,
            BENT,
        )
        rate = np.zeros(6) if self._angles is None else (angles - self._angles) / self._turn_s
        np.clip(rate, -FASTEST_RAD_S, FASTEST_RAD_S, out=rate)
        if self._angles is not None:
            faster = np.clip((rate - self._rate) / self._turn_s, -FASTER_RAD_S2, FASTER_RAD_S2)
            self._acceleration += SMOOTH * (faster - self._acceleration)
        self._angles, self._rate = angles, rate
        self._wanted[self.dof] = AHEAD * self._acceleration
        mujoco.mj_mulM(self._model, data, self._inertial, self._wanted)
        move: Floats = self._kp * (angles - data.qpos[self.q]) + self._kd * (rate - data.qvel[self.dof])
        move = move * size.strength + self._inertial[self.dof]
        limit = self._torque * strength
        return np.clip(move, -limit, limit)

    def turns_pelvis(self, move: Floats) -> Floats:
        """Return the moment (3,) with which the leg's torques turn the pelvis [N m]."""
        reaction: Floats = self._data.xaxis[self._hip_joint].T @ move[:3]
        return reaction
