"""The walker's rigid-body model: what Pinocchio says of it in the four directions it can move.

Directions everywhere: x forward, y left, yaw, column height; velocities are those of the base in the base frame.
Wheel speeds are not free: the rollers tie them to the base's twist, so every quantity of the eight-joint model is
reduced with `v_joints = T v`, T constant in the base frame (no-slip mecanum constraint).

The free model obeys `M a + n = Q`, with Q the forces of drives, column and interface along the four directions.
"""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from bridge.config.walker import WalkerConfig
from bridge.messages import Floats

WHEELS = ("wheel_front_left", "wheel_front_right", "wheel_rear_left", "wheel_rear_right")
_SIDE = {"front": 1.0, "rear": -1.0, "left": 1.0, "right": -1.0}


class WalkerTerms(NamedTuple):
    """The model at one height and velocity. Arrays are the walker's own and change with the next `evaluate`."""

    mass: Floats  # (4, 4) M with reflected motor inertia [kg, kg m, kg m^2]
    bias: Floats  # (4,) n: centrifugal, Coriolis and gravity forces [N, N, N m, N]
    momentum: Floats  # (6, 4) A: momentum about the centre of mass = A v, linear then angular [kg, kg m, kg m^2]
    momentum_bias: Floats  # (6,) A' v [N, N m]
    centre_of_mass: Floats  # (3,) in the base frame [m]
    interface: Floats  # (6, 4) Jacobian of the interface frame, linear then angular, base frame axes
    interface_position: Floats  # (3,) in the base frame [m]

    @property
    def column_gravity(self) -> float:
        """Force that carries the column at rest [N]."""
        return float(self.bias[3])


class Body(NamedTuple):
    """A rigid body of the walker, as it lies with the base at the origin and the interface on the floor."""

    mass_kg: float
    centre: Floats  # (3,) centre of mass in the base frame [m]
    inertia: Floats  # (3, 3) about the centre of mass, base frame axes [kg m^2]
    spin: Floats  # (3,) speed about the base's y axis for unit (v_x, v_y, yaw rate): wheels
    lifted: float  # 1 if it rises with the column, else 0


class Walker:
    """Rigid-body model of a configured walker, evaluated without allocating.

    Attributes:
        wheel_jacobian: (4, 3), wheel speeds [rad/s] = J (v_x, v_y, yaw rate).
        wheel_force: (4, 3), least-norm wheel torques [N m] that give the base a wanted force (F_x, F_y, M_z).
        reflected: (4, 4), the part of the mass matrix that turns with wheels and motors and never loads the floor.
        rotors: (4, 4), the motors' part of that.
        weight: weight of the whole walker [N].
    """

    def __init__(self, config: WalkerConfig) -> None:
        self.config = config
        self._model = pin.buildModelFromXML(urdf(config), pin.JointModelPlanar())
        self._data = self._model.createData()
        self._interface_id = self._model.getFrameId("interface")
        # URDF loading sorts the joints by name, so every index is looked up.
        self._column_q, column_v = self._indices("column")
        wheel_v = [self._indices(wheel)[1] for wheel in WHEELS]
        base_v = self._model.joints[self._model.getJointId("root_joint")].idx_v

        armature = np.zeros(self._model.nv)
        armature[wheel_v] = config.wheel_rotor_inertia_kg_m2 * config.wheel_gear_ratio**2
        armature[column_v] = config.column_rotor_inertia_kg_m2 * (2 * np.pi / config.column_lead_m) ** 2
        self._model.armature = armature

        # Base at the origin: everything below is wanted in the base frame, and wheel angles do not matter.
        # neutral() also sets the (cos, sin) pairs of the planar joint and of the wheels.
        self._q: Floats = pin.neutral(self._model)
        self._v: Floats = np.zeros(self._model.nv)

        self.wheel_jacobian = self._roller_constraint(base_v)
        self.wheel_force: Floats = np.asarray(np.linalg.pinv(self.wheel_jacobian.T), dtype=np.float64)
        self._reduce: Floats = np.zeros((self._model.nv, 4))
        self._reduce[base_v : base_v + 3, :3] = np.eye(3)
        self._reduce[wheel_v, :3] = self.wheel_jacobian
        self._reduce[column_v, 3] = 1.0
        wheels = [self._model.inertias[self._model.getJointId(wheel)].inertia[1, 1] for wheel in WHEELS]
        spinning = armature.copy()
        spinning[wheel_v] += wheels
        self.reflected: Floats = self._reduce.T @ (spinning[:, None] * self._reduce)
        self.rotors: Floats = self._reduce.T @ (armature[:, None] * self._reduce)
        self.weight = config.mass_kg * config.gravity_m_s2
        self._model.gravity.linear = np.array([0.0, 0.0, -config.gravity_m_s2])

        self._joint_mass_reduced: Floats = np.zeros((self._model.nv, 4))
        self.terms = WalkerTerms(
            np.zeros((4, 4)), np.zeros(4), np.zeros((6, 4)), np.zeros(6), np.zeros(3), np.zeros((6, 4)), np.zeros(3)
        )
        self.evaluate(config.column_low_m, np.zeros(4))

    def evaluate(self, height_m: float, velocity: Floats) -> WalkerTerms:
        """Evaluate the model at a column height and a velocity.

        Args:
            height_m: height of the interface above the floor [m].
            velocity: (4,) forward, left [m/s], yaw [rad/s], column [m/s].
        """
        terms, model, data = self.terms, self._model, self._data
        self._q[self._column_q] = height_m
        np.dot(self._reduce, velocity, out=self._v)
        # Also computes the momentum matrix, its bias, the centre of mass, crba's M and the joint Jacobians.
        pin.computeAllTerms(model, data, self._q, self._v)
        joint_mass: Floats = data.M
        np.dot(joint_mass, self._reduce, out=self._joint_mass_reduced)
        np.dot(self._reduce.T, self._joint_mass_reduced, out=terms.mass)
        np.dot(self._reduce.T, data.nle, out=terms.bias)
        pin.dccrba(model, data, self._q, self._v)
        np.dot(data.Ag, self._reduce, out=terms.momentum)
        np.dot(data.dAg, self._v, out=terms.momentum_bias)
        terms.centre_of_mass[:] = data.com[0]
        jacobian = pin.getFrameJacobian(model, data, self._interface_id, pin.LOCAL_WORLD_ALIGNED)
        np.dot(jacobian, self._reduce, out=terms.interface)
        terms.interface_position[:] = data.oMf[self._interface_id].translation
        return terms

    def bodies(self) -> tuple[list[Body], Floats]:
        """Return the bodies and the interface's position (3,), both with the interface on the floor, base frame [m]."""
        data = self._model.createData()
        q = pin.neutral(self._model)
        q[self._column_q] = 0.0
        pin.framesForwardKinematics(self._model, data, q)
        found = []
        for joint, inertia in enumerate(self._model.inertias):
            name = self._model.names[joint]
            if joint == 0:
                continue  # the universe
            placement = data.oMi[joint]
            turn = np.array(placement.rotation)
            spin = self.wheel_jacobian[WHEELS.index(name)] if name in WHEELS else np.zeros(3)
            found.append(
                Body(
                    float(inertia.mass),
                    np.array(placement.act(inertia.lever)),
                    turn @ np.array(inertia.inertia) @ turn.T,
                    spin,
                    1.0 if name == "column" else 0.0,
                )
            )
        return found, np.array(data.oMf[self._interface_id].translation)

    def _indices(self, joint: str) -> tuple[int, int]:
        handle = self._model.joints[self._model.getJointId(joint)]
        return handle.idx_q, handle.idx_v

    def _roller_constraint(self, base_v: int) -> Floats:
        """Wheel speeds for a base twist, from where the model has its wheels.

        A mecanum wheel grips the floor along its roller's axis e alone: `(v_centre - r w x) . e = 0`, so
        `w = e . v_centre / (r e_x)`. Rollers on the floor point inward at 45 degrees in front left and rear right,
        outward in the others (X configuration; Taheri et al. 2015, Int. J. Computer Applications 113(3)).
        """
        jacobian = np.zeros((4, 3))
        pin.computeJointJacobians(self._model, self._data, self._q)
        for row, wheel in enumerate(WHEELS):
            _, end, side = wheel.split("_")
            roller = np.array([1.0, -_SIDE[end] * _SIDE[side]])
            centre = pin.getJointJacobian(
                self._model, self._data, self._model.getJointId(wheel), pin.LOCAL_WORLD_ALIGNED
            )[:2, base_v : base_v + 3]
            jacobian[row] = roller @ centre / (self.config.wheel_radius_m * roller[0])
        return jacobian


def urdf(config: WalkerConfig) -> str:
    """Return the walker's URDF with the configured masses, sizes and limits."""
    robot = ElementTree.fromstring(resources.files("controller").joinpath("walker.urdf").read_text("utf-8"))  # noqa: S314
    box = (
        config.chassis_mass_kg
        / 12.0
        * np.square([config.chassis_length_m, config.chassis_width_m, config.chassis_box_height_m])
    )
    _write_inertial(
        robot,
        "base",
        config.chassis_mass_kg,
        (config.chassis_com_forward_m, 0.0, config.chassis_com_height_m),
        (box[1] + box[2], box[0] + box[2], box[0] + box[1]),
    )
    spin = 0.5 * config.wheel_mass_kg * config.wheel_radius_m**2
    across = 0.5 * spin + config.wheel_mass_kg * config.wheel_width_m**2 / 12.0
    for wheel in WHEELS:
        _, end, side = wheel.split("_")
        _write_inertial(robot, wheel, config.wheel_mass_kg, None, (across, spin, across))
        _find(robot, f"./joint[@name='{wheel}']/origin").set(
            "xyz",
            f"{_SIDE[end] * config.wheelbase_m / 2!r} {_SIDE[side] * config.track_m / 2!r} {config.wheel_radius_m!r}",
        )
    rod = config.carriage_mass_kg * config.carriage_width_m**2 / 12.0
    # A rod has no inertia about itself; a small one keeps the matrix physically valid for every URDF reader.
    _write_inertial(
        robot, "carriage", config.carriage_mass_kg, (0.0, 0.0, -config.carriage_com_below_m), (rod, 1e-3, rod)
    )
    limit = _find(robot, "./joint[@name='column']/limit")
    limit.set("lower", repr(config.column_low_m))
    limit.set("upper", repr(config.column_high_m))
    limit.set("velocity", repr(config.column_speed_max_m_s))
    limit.set("effort", repr(config.column_force_max_n))
    return ElementTree.tostring(robot, encoding="unicode")


def _find(robot: ElementTree.Element, path: str) -> ElementTree.Element:
    element = robot.find(path)
    if element is None:
        raise LookupError(f"walker.urdf has no {path}")
    return element


def _write_inertial(
    robot: ElementTree.Element,
    link: str,
    mass: float,
    centre: tuple[float, float, float] | None,
    diagonal: tuple[float, float, float],
) -> None:
    inertial = _find(robot, f"./link[@name='{link}']/inertial")
    _find(inertial, "mass").set("value", repr(float(mass)))
    if centre is not None:
        _find(inertial, "origin").set("xyz", " ".join(repr(float(value)) for value in centre))
    inertia = _find(inertial, "inertia")
    for name, value in zip(("ixx", "iyy", "izz"), diagonal, strict=True):
        inertia.set(name, repr(float(value)))
