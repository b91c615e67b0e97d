"""Person, walker and harness on a floor, moved together.

World axes: x forward at the start, y left, z up. Everything that happens comes from forces: of contacts, motors,
harness and disturbances.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from bridge.messages import Floats
from simulation.person.ability import FRAIL, Ability
from simulation.person.anthropometry import BodySize
from simulation.person.body import HIPS, PERSON, SURROUNDINGS, add_person
from simulation.person.person import CONTROL_S, Intent, Person
from simulation.world.harness import HarnessWrench, harness_wrench
from simulation.world.looks import dress
from simulation.world.parameters import HarnessParameters, WalkerParameters
from simulation.world.walker import WALKER_CLASS, WalkerPlant, add_walker

STEP_S: Final = 0.002
STEPS_A_TURN: Final = round(CONTROL_S / STEP_S)
FLOOR_FRICTION: Final = 0.8
BODY_PARTS: Final = (
    "l_upper_arm", "r_upper_arm", "l_forearm", "r_forearm", "", "", "l_thigh", "r_thigh", "l_shank", "r_shank",
    "l_foot", "r_foot",
)  # fmt: skip
IMPACTS: Final = ("pelvis", "torso", "head", "l_shank", "r_shank", "l_thigh", "r_thigh")


SEAT_M: Final = 0.08  # thickness of a seat


class Seat(NamedTuple):
    """A chair: a cushion that carries the hips and nothing else."""

    x_m: float  # of its middle
    height_m: float = 0.45
    depth_m: float = 0.45


class Odometry(NamedTuple):
    """Of the walker: pose in the world, velocity in its own axes."""

    position: tuple[float, float, float]  # x, y, column height [m]
    yaw: float
    velocity: tuple[float, float, float]  # forward, left, column [m/s]
    yaw_rate: float
    tilt: float  # of the frame from upright [rad]


class World:
    """The simulated world; `advance` moves it on.

    Attributes:
        person: the person's nervous system.
        walker: motors, wheels and column.
        wrench: what the person exerts on the walker at the interface now, without the sensor's errors.
    """

    def __init__(
        self,
        size: BodySize,
        ability: Ability = FRAIL,
        walker: WalkerParameters | None = None,
        harness: HarnessParameters | None = None,
        interface_height_m: float = 1.0,
        seat: Seat | None = None,
        worn: bool = True,
    ) -> None:
        parameters = WalkerParameters() if walker is None else walker
        spec = mujoco.MjSpec()
        spec.option.timestep = STEP_S
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.compiler.degree = False
        spec.worldbody.add_geom(
            name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[40, 40, 1], friction=[FLOOR_FRICTION, 0.005, 0.0001],
            contype=SURROUNDINGS, conaffinity=PERSON | WALKER_CLASS, rgba=[0.93, 0.93, 0.92, 1],
        )  # fmt: skip
        if seat is not None:
            spec.worldbody.add_geom(
                name="seat", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[seat.x_m, 0, seat.height_m - SEAT_M / 2],
                size=[seat.depth_m / 2, 0.25, SEAT_M / 2], contype=0, conaffinity=HIPS, solref=[0.05, 1.0],
                friction=[1.0, 0.005, 0.0001], priority=1, rgba=[0.6, 0.45, 0.3, 1],
            )  # fmt: skip
            spec.worldbody.add_geom(
                name="chair", type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=[seat.x_m - 0.3 * seat.depth_m, 0, (seat.height_m - SEAT_M) / 2],
                size=[0.2 * seat.depth_m, 0.2, (seat.height_m - SEAT_M) / 2], contype=0, conaffinity=0,
                rgba=[0.5, 0.37, 0.25, 1],
            )  # fmt: skip
        add_person(spec, size)
        add_walker(spec, parameters)
        spec.worldbody.add_light(pos=[0, -3, 5], dir=[0, 0.5, -1], diffuse=[0.35, 0.35, 0.35])
        dress(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.data.qpos[self.model.joint("column").qposadr[0]] = interface_height_m
        self.person = Person(self.model, self.data, size, ability)
        self.walker = WalkerPlant(self.model, self.data, parameters, STEP_S)
        self.drive = self.person.act  # what sets the person's torques
        self.wrench = HarnessWrench(0.0, 0.0, 0.0, 0.0)
        self._harness = HarnessParameters() if harness is None else harness
        self._worn = worn
        self._carriage = self.model.body("carriage").id
        self._pelvis = self.person.pelvis
        self._hang_m = float(self.data.xpos[self._pelvis][2]) - interface_height_m
        self._parts = [self.model.body(name).id if name else -1 for name in BODY_PARTS]
        self._forearms = [self.model.body(f"{side}_forearm").id for side in "lr"]
        self._impacts = frozenset(self.model.geom(name).id for name in IMPACTS)
        self._seat = -1 if seat is None else self.model.geom("seat").id
        self._velocity = np.zeros(6)
        self.time_s = 0.0
        self.disturbing: list[tuple[int, Floats]] = []  # (body, (6,) force and torque), for the next turn only
        self.leaning_n = 0.0  # with which the person leans on the bar in the next turn

    def advance(self, command: Sequence[float] | Floats, intent: Intent) -> None:
        """Move on by CONTROL_S with `command` (forward, left, yaw, column velocity) and the person wanting `intent`."""
        data = self.data
        wanted = np.asarray(command, dtype=np.float64)
        self.drive(intent)
        for _ in range(STEPS_A_TURN):
            data.xfrc_applied[:] = 0.0
            self.walker.apply(wanted)
            if self._worn:
                self._couple()
            if self.leaning_n > 0.0 and self._worn:
                self._lean()
            for body, wrench in self.disturbing:
                data.xfrc_applied[body] += wrench
            mujoco.mj_step(self.model, data)
        self.disturbing.clear()
        self.leaning_n = 0.0
        self.time_s += CONTROL_S

    def odometry(self) -> Odometry:
        """Return where the walker is and how it moves."""
        m = self.data.xmat[self.walker.body]
        twist = self.walker.body_twist()
        x, y, _ = self.data.xpos[self.walker.body]
        return Odometry(
            (float(x), float(y), self.walker.height_m), atan2(m[3], m[0]),
            (float(twist[3]), float(twist[4]), self.walker.column_speed_m_s), float(twist[2]),
            float(np.arccos(np.clip(m[8], -1.0, 1.0))),
        )  # fmt: skip

    def keypoints(self) -> Floats:
        """Return the twelve keypoints (12, 3) in the world [m]."""
        data = self.data
        points = np.empty((12, 3))
        for index, part in enumerate(self._parts):
            if part >= 0:
                points[index] = data.xpos[part]
        length = self.person.size.forearm_m
        for side, part in enumerate(self._forearms):
            points[4 + side] = data.xpos[part] - length * data.xmat[part].reshape(3, 3)[:, 2]
        return points

    @property
    def pelvis_m(self) -> Floats:
        """Position of the pelvis (3,) [m]."""
        position: Floats = self.data.xpos[self._pelvis]
        return position

    @property
    def pelvis_velocity_m_s(self) -> Floats:
        """Velocity of the pelvis (3,) [m/s]."""
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._pelvis, self._velocity, 0)
        return self._velocity[3:]

    def velocity_of(self, body: int) -> tuple[float, float, float]:
        """Return the velocity of a body's origin in the world [m/s]."""
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, self._velocity, 0)
        return float(self._velocity[3]), float(self._velocity[4]), float(self._velocity[5])

    def set_sole_friction(self, friction: float | None) -> None:
        """Make both soles as slippery as `friction`, or as they were (None)."""
        for sole in self.person.sole.values():
            self.model.geom_friction[sole, 0] = FLOOR_FRICTION if friction is None else friction

    def touched_down(self) -> str:
        """Return the body part other than soles and arms that touches the floor, or ''."""
        contact = self.data.contact
        for first, second in zip(contact.geom1.tolist(), contact.geom2.tolist(), strict=True):
            other = second if first == 0 else first if second == 0 else -1
            if other in self._impacts:
                return str(self.model.geom(other).name)
        return ""

    def seat_force_n(self) -> float:
        """Return the weight that the chair carries [N]; 0 without one."""
        if self._seat < 0:
            return 0.0
        total = 0.0
        for contact in self.data.contact:
            if self._seat in (contact.geom1, contact.geom2) and contact.efc_address >= 0:
                rows = 2 * (contact.dim - 1)  # edges of the friction pyramid, each with the whole normal share
                total += float(self.data.efc_force[contact.efc_address : contact.efc_address + rows].sum())
        return total

    def _couple(self) -> None:
        """Apply the harness to pelvis and carriage."""
        data = self.data
        m = data.xmat[self.walker.body]
        yaw = atan2(m[3], m[0])
        c, s = cos(yaw), sin(yaw)
        interface = data.xpos[self._carriage]
        pelvis, trunk = data.xpos[self._pelvis], data.xmat[self._pelvis]
        dx, dy = float(pelvis[0] - interface[0]), float(pelvis[1] - interface[1])
        self._velocities()
        vx, vy, vz, spin = self._relative
        turn = atan2(trunk[3], trunk[0]) - yaw
        self.wrench = harness_wrench(
            self._harness,
            (c * dx + s * dy, c * dy - s * dx, float(pelvis[2] - interface[2]) - self._hang_m,
             atan2(sin(turn), cos(turn))),
            (c * vx + s * vy, c * vy - s * vx, vz, spin),
        )  # fmt: skip
        w = self.wrench
        if w == (0.0, 0.0, 0.0, 0.0):
            return
        fx, fy = c * w.forward_n - s * w.left_n, s * w.forward_n + c * w.left_n
        for body, sign, point in ((self._carriage, 1.0, interface), (self._pelvis, -1.0, pelvis)):
            rx, ry, rz = (point - data.xipos[body]).tolist()
            gx, gy, gz = sign * fx, sign * fy, sign * w.up_n
            data.xfrc_applied[body] += (
                gx, gy, gz, ry * gz - rz * gy, rz * gx - rx * gz, rx * gy - ry * gx + sign * w.yaw_nm
            )  # fmt: skip

    def _lean(self) -> None:
        """Let the arms put weight on the bar; the sensor under it feels that too."""
        data, force = self.data, self.leaning_n
        point = data.xpos[self._carriage]
        for body, push in ((self._carriage, -force), (self.person.torso, force)):
            rx, ry, _ = (point - data.xipos[body]).tolist()
            data.xfrc_applied[body] += (0.0, 0.0, push, ry * push, -rx * push, 0.0)
        self.wrench = self.wrench._replace(up_n=self.wrench.up_n - force)

    def _velocities(self) -> None:
        """Find the pelvis' velocity relative to the interface (vx, vy, vz, yaw rate) in world axes."""
        kind = mujoco.mjtObj.mjOBJ_BODY
        mujoco.mj_objectVelocity(self.model, self.data, kind, self._pelvis, self._velocity, 0)
        a = self._velocity.tolist()
        mujoco.mj_objectVelocity(self.model, self.data, kind, self._carriage, self._velocity, 0)
        b = self._velocity.tolist()
        self._relative = (a[3] - b[3], a[4] - b[4], a[5] - b[5], a[2] - b[2])


def sensed(wrench: HarnessWrench, bias: Floats, noise: Any, parameters: WalkerParameters) -> tuple[Floats, Floats]:
    """Return force (3,) [N] and torque (3,) [N m] as the sensor reports them; `noise` draws unit normals."""
    draw = noise(6)
    force = np.array([wrench.forward_n, wrench.left_n, wrench.up_n]) + bias + parameters.force_noise_n * draw[:3]
    torque = np.array([0.0, 0.0, wrench.yaw_nm]) + parameters.torque_noise_nm * draw[3:]
    return force, torque
