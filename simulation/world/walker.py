"""The walker in MuJoCo: a frame that can tip, four mecanum wheels that can slip, a column with limits.

The rollers carry load without friction of their own; what drives the frame is traction along each wheel's driving
direction, proportional to slip up to the friction of the load the wheel carries at that moment. Wheels in O
arrangement, rollers at 45 degrees: wheel speeds are (v_x -+ v_y -+ (l + w) yaw rate) / r.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

import mujoco
import numpy as np

from bridge.messages import Floats
from simulation.world.parameters import WalkerParameters

WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")
SIGNS: Final = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])  # front/rear, left/right
GRAVITY_M_S2: Final = 9.81
WALKER_CLASS: Final = 4  # collision class: the floor alone


def add_walker(spec: Any, parameters: WalkerParameters) -> None:
    """Add the walker at the origin, facing +x; the column's position is the height of the interface."""
    p = parameters
    frame = spec.worldbody.add_body(name="walker", pos=[0.0, 0.0, 0.0])
    frame.add_freejoint(name="walker")
    frame.mass, frame.explicitinertial = p.chassis_mass_kg, True
    frame.ipos, frame.inertia = list(p.chassis_com_m), list(p.chassis_inertia_kg_m2)
    for name, (along, across) in zip(WHEELS, SIGNS, strict=True):
        frame.add_geom(
            name=f"wheel_{name}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[p.wheel_radius_m, 0, 0], mass=0.0,
            condim=1, priority=2,
            pos=[along * p.wheelbase_m / 2, across * p.track_m / 2, p.wheel_radius_m], rgba=[0.15, 0.15, 0.15, 1],
            contype=WALKER_CLASS, conaffinity=0, solref=[0.01, 1.0],
        )  # fmt: skip
    _looks(frame, p)
    carriage = frame.add_body(name="carriage", pos=[0.0, 0.0, 0.0])
    carriage.add_joint(
        name="column", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], range=[p.column_low_m, p.column_high_m],
        limited=1, ref=0.0, armature=2.0,
    )  # fmt: skip
    carriage.mass, carriage.explicitinertial = p.carriage_mass_kg, True
    carriage.ipos, carriage.inertia = [0.0, 0.0, -0.05], [0.7, 0.05, 0.7]
    carriage.add_geom(
        name="bar", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, -0.30, 0, 0, 0.30, 0], size=[0.02, 0, 0], mass=0.0,
        contype=0, conaffinity=0, rgba=[0.85, 0.55, 0.15, 1],
    )  # fmt: skip
    carriage.add_site(name="interface", pos=[0, 0, 0])


def _looks(frame: Any, p: WalkerParameters) -> None:
    """Add what is seen of the frame; it touches nothing."""
    for across in (1.0, -1.0):
        y = across * p.track_m / 2
        for start, end in (
            ((-p.wheelbase_m / 2, y, 0.14), (p.wheelbase_m / 2, y, 0.14)),
            ((0.0, y, 0.14), (0.0, y, 1.15)),
        ):
            frame.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[0.025, 0, 0], mass=0.0,
                contype=0, conaffinity=0, rgba=[0.45, 0.5, 0.55, 1],
            )  # fmt: skip


class WalkerPlant:
    """Motors, wheels and column between commanded velocities and forces on the frame."""

    def __init__(self, model: Any, data: Any, parameters: WalkerParameters, step_s: float) -> None:
        """Rest at the column height that `data` holds; `step_s` is the simulation's step [s]."""
        self._model, self._data, self._p, self._dt = model, data, parameters, step_s
        self.body = model.body("walker").id
        self._geoms = np.array([model.geom(f"wheel_{name}").id for name in WHEELS])
        joint = model.joint("column")
        self._column_q, self._column_dof = joint.qposadr[0], joint.dofadr[0]
        # wheel speed per base twist, rows as WHEELS; a wheel drives along the first two entries of its row
        across = -SIGNS[:, 0] * SIGNS[:, 1]
        reach = (parameters.wheelbase_m + parameters.track_m) / 2
        self._jacobian = np.column_stack((np.ones(4), across, -SIGNS[:, 1] * reach)) / parameters.wheel_radius_m
        self._spin = np.zeros(4)
        self._torque = np.zeros(4)
        self._integral = np.zeros(4)
        self._delayed: list[Floats] = [np.zeros(4) for _ in range(max(round(parameters.command_delay_s / step_s), 1))]
        self._index = 0
        self._target_m = float(data.qpos[self._column_q])
        self._twist = np.zeros(6)
        self._load = np.zeros(4)

    @property
    def height_m(self) -> float:
        """Height of the interface above the frame's origin [m]."""
        return float(self._data.qpos[self._column_q])

    @property
    def column_speed_m_s(self) -> float:
        """Speed of the column [m/s]."""
        return float(self._data.qvel[self._column_dof])

    @property
    def wheel_loads_n(self) -> Floats:
        """Vertical load of each wheel (4,) [N]."""
        return self._load

    def body_twist(self) -> Floats:
        """Return (6,) angular then linear velocity of the frame in its own axes [rad/s, m/s]."""
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_BODY, self.body, self._twist, 1)
        return self._twist

    def apply(self, command: Floats) -> None:
        """Set the forces of the next step for commanded velocities (forward, left, yaw, column) [m/s, rad/s]."""
        wanted = self._delayed[self._index]
        self._delayed[self._index] = np.array(command, dtype=np.float64)
        self._index = (self._index + 1) % len(self._delayed)
        self._drive(wanted)
        self._lift(float(wanted[3]))

    def _drive(self, wanted: Floats) -> None:
        p, dt = self._p, self._dt
        self._load = self._loads()
        goal = self._jacobian @ wanted[:3]
        fastest = np.abs(goal).max()
        if fastest > p.wheel_speed_max_rad_s:
            goal *= p.wheel_speed_max_rad_s / fastest
        error = goal - self._spin
        self._integral += p.wheel_integral_nm_rad * error * dt
        np.clip(self._integral, -p.wheel_torque_max_nm, p.wheel_torque_max_nm, out=self._integral)
        asked = np.clip(p.wheel_gain_nms_rad * error + self._integral, -p.wheel_torque_max_nm, p.wheel_torque_max_nm)
        self._torque += (asked - self._torque) * (dt / (p.motor_lag_s + dt))
        twist = self.body_twist()
        rolling = self._jacobian @ np.array([twist[3], twist[4], twist[2]]) * p.wheel_radius_m
        grip = p.friction * self._load / sqrt(2.0)  # a wheel's driving force lies 45 degrees off its plane
        traction = np.clip(p.slip_damping_ns_m * (self._spin * p.wheel_radius_m - rolling), -grip, grip)
        drag = p.rolling_resistance_n * np.tanh(self._spin / 0.2) * p.wheel_radius_m
        self._spin += (self._torque - traction * p.wheel_radius_m - drag) / p.wheel_inertia_kg_m2 * dt
        fx, fy, turn = (traction @ self._jacobian * p.wheel_radius_m).tolist()
        rotation, applied = self._data.xmat[self.body], self._data.xfrc_applied[self.body]
        wx, wy = rotation[0] * fx + rotation[1] * fy, rotation[3] * fx + rotation[4] * fy
        # traction acts on the floor under the frame's origin, MuJoCo's external force at the centre of mass
        rx, ry, rz = (self._data.xpos[self.body] - self._data.xipos[self.body]).tolist()
        applied[:] = (wx, wy, 0.0, -rz * wy, rz * wx, turn + rx * wy - ry * wx)

    def _lift(self, speed: float) -> None:
        """Follow a speed with a position servo: the column does not sink when the speed is zero."""
        p = self._p
        speed = min(max(speed, -p.column_speed_max_m_s), p.column_speed_max_m_s)
        reach = p.column_force_max_n / p.column_stiffness_n_m
        target = min(max(self._target_m + speed * self._dt, p.column_low_m), p.column_high_m)
        self._target_m = min(max(target, self.height_m - reach), self.height_m + reach)
        force = p.column_stiffness_n_m * (self._target_m - self.height_m)
        force += p.column_damping_ns_m * (speed - self.column_speed_m_s) + p.carriage_mass_kg * GRAVITY_M_S2
        self._data.qfrc_applied[self._column_dof] = min(max(force, -p.column_force_max_n), p.column_force_max_n)

    def _loads(self) -> Floats:
        """Return the vertical load of each wheel [N]."""
        loads = np.zeros(4)
        contact, data = self._data.contact, self._data
        if data.ncon == 0:
            return loads
        for wheel, geom in enumerate(self._geoms):
            for index in np.flatnonzero((contact.geom1 == geom) | (contact.geom2 == geom)):
                address = int(contact.efc_address[index])
                if address >= 0:
                    loads[wheel] += float(data.efc_force[address])
        return loads
