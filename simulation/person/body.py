"""The body in MuJoCo: 14 segments, 21 hinges with torque motors, contact with the floor and with furniture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import mujoco

from simulation.person import anthropometry as tables
from simulation.person.anthropometry import BodySize, Segment

LEG_JOINTS: Final = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
UPPER_JOINTS: Final = (
    "lumbar_pitch", "lumbar_roll", "lumbar_yaw",
    "l_shoulder_pitch", "r_shoulder_pitch", "l_shoulder_roll", "r_shoulder_roll", "l_elbow", "r_elbow",
)  # fmt: skip
SIDES: Final = (("l", 1.0), ("r", -1.0))

# What an untrained adult of 70 kg and 1.70 m can do for a moment [N m]; assumed, in the range of dynamometer studies.
TORQUE_NM: Final = {
    "hip_yaw": 60.0, "hip_roll": 150.0, "hip_pitch": 200.0, "knee": 200.0, "ankle_pitch": 140.0, "ankle_roll": 60.0,
    "lumbar_pitch": 200.0, "lumbar_roll": 200.0, "lumbar_yaw": 100.0,
    "shoulder_pitch": 60.0, "shoulder_roll": 60.0, "elbow": 50.0,
}  # fmt: skip

PERSON: Final = 2  # collision class of the body: it meets the floor and furniture, not itself, not the walker
SURROUNDINGS: Final = 1
HIPS: Final = 8  # of the hips alone: a chair carries them


def add_person(spec: Any, size: BodySize, friction: float = 0.8, forward_m: float = 0.0) -> None:
    """Add a person to `spec`, standing upright at (`forward_m`, 0), facing +x.

    Args:
        spec: the mujoco.MjSpec to add to.
        size: height and weight.
        friction: of soles and skin on the floor.
        forward_m: where the hips are [m].
    """
    h, mass = size.height_m, size.mass_kg
    pelvis = spec.worldbody.add_body(name="pelvis", pos=[forward_m, 0.0, size.leg_m + size.ankle_height_m])
    pelvis.add_freejoint(name="root")
    _inertia(pelvis, tables.PELVIS, mass, size.lumbar_height_m, up=True)
    _capsule(pelvis, "pelvis", (0, -0.05 * h, 0.02 * h), (0, 0.05 * h, 0.02 * h), 0.065 * h, friction)

    spec.geom("pelvis").contype = PERSON | HIPS
    torso = pelvis.add_body(name="torso", pos=[0, 0, size.lumbar_height_m])
    _hinge(spec, torso, "lumbar_pitch", (0, 1, 0), (-0.6, 1.6), size, armature=0.05, damping=3.0)
    _hinge(spec, torso, "lumbar_roll", (1, 0, 0), (-0.5, 0.5), size, armature=0.05, damping=3.0)
    _hinge(spec, torso, "lumbar_yaw", (0, 0, 1), (-0.6, 0.6), size, armature=0.05, damping=3.0)
    above = size.trunk_m - size.lumbar_height_m
    _inertia(torso, tables.TRUNK, mass, above + 0.02 * h, up=True)
    _capsule(torso, "torso", (0, 0, 0.04 * h), (0, 0, above - 0.03 * h), 0.075 * h, friction)

    head = torso.add_body(name="head", pos=[0, 0, above])
    _inertia(head, tables.HEAD, mass, 0.14 * h, up=True, offset=0.04 * h)
    head.add_geom(
        name="head", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.06 * h, 0, 0], pos=[0.01 * h, 0, 0.115 * h],
        **_touching(friction),
    )  # fmt: skip
    for side, sign in SIDES:
        _add_arm(spec, torso, side, sign, size, above, friction)
        _add_leg(spec, pelvis, side, sign, size, friction)


def _add_arm(spec: Any, torso: Any, side: str, sign: float, size: BodySize, shoulder_m: float, friction: float) -> None:
    h, mass = size.height_m, size.mass_kg
    upper = torso.add_body(name=f"{side}_upper_arm", pos=[0, sign * size.shoulder_half_width_m, shoulder_m - 0.01 * h])
    _hinge(spec, upper, f"{side}_shoulder_pitch", (0, 1, 0), (-3.0, 1.2), size, armature=0.01)
    outward = (-0.3, 2.5) if sign > 0 else (-2.5, 0.3)
    _hinge(spec, upper, f"{side}_shoulder_roll", (1, 0, 0), outward, size, armature=0.01)
    _inertia(upper, tables.UPPER_ARM, mass, size.upper_arm_m)
    _capsule(upper, f"{side}_upper_arm", (0, 0, 0), (0, 0, -size.upper_arm_m), 0.024 * h, friction)
    fore = upper.add_body(name=f"{side}_forearm", pos=[0, 0, -size.upper_arm_m])
    _hinge(spec, fore, f"{side}_elbow", (0, 1, 0), (-2.5, 0.0), size, armature=0.01, damping=0.5)
    _inertia(fore, tables.FOREARM, mass, size.forearm_m)
    _capsule(fore, f"{side}_forearm", (0, 0, 0), (0, 0, -size.forearm_m - 0.05 * h), 0.02 * h, friction)


def _add_leg(spec: Any, pelvis: Any, side: str, sign: float, size: BodySize, friction: float) -> None:
    h, mass = size.height_m, size.mass_kg
    thigh = pelvis.add_body(name=f"{side}_thigh", pos=[0, sign * size.hip_half_width_m, 0])
    _hinge(spec, thigh, f"{side}_hip_yaw", (0, 0, 1), (-0.8, 0.8), size)
    _hinge(spec, thigh, f"{side}_hip_roll", (1, 0, 0), (-0.7, 0.7), size)
    _hinge(spec, thigh, f"{side}_hip_pitch", (0, 1, 0), (-2.1, 0.6), size)
    _inertia(thigh, tables.THIGH, mass, size.thigh_m)
    _capsule(thigh, f"{side}_thigh", (0, 0, -0.02), (0, 0, -size.thigh_m), 0.045 * h, friction)
    shank = thigh.add_body(name=f"{side}_shank", pos=[0, 0, -size.thigh_m])
    _hinge(spec, shank, f"{side}_knee", (0, 1, 0), (0.0, 2.5), size)
    _inertia(shank, tables.SHANK, mass, size.shank_m)
    _capsule(shank, f"{side}_shank", (0, 0, 0), (0, 0, -size.shank_m + 0.02), 0.03 * h, friction)
    foot = shank.add_body(name=f"{side}_foot", pos=[0, 0, -size.shank_m])
    _hinge(spec, foot, f"{side}_ankle_pitch", (0, 1, 0), (-0.7, 0.9), size, armature=0.01, damping=0.5)
    _hinge(spec, foot, f"{side}_ankle_roll", (1, 0, 0), (-0.5, 0.5), size, armature=0.01, damping=0.5)
    part = tables.FOOT
    weight = part.mass * mass
    foot.mass = weight
    foot.ipos = [0.19 * size.foot_m, 0.0, -0.02 * h]
    foot.inertia = [weight * (g * size.foot_m) ** 2 for g in part.gyration]
    foot.explicitinertial = True
    half_height = 0.012
    foot.add_geom(
        name=f"{side}_sole", type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[size.foot_m / 2, size.sole_half_width_m, half_height],
        pos=[size.sole_forward_m, 0.0, half_height - size.ankle_height_m],
        priority=1, solref=[0.04, 1.0], **_touching(friction, torsion=0.03),
    )  # fmt: skip


def _inertia(body: Any, part: Segment, mass: float, length: float, up: bool = False, offset: float = 0.0) -> None:
    """Set mass, centre and inertia of a segment that hangs down (or stands up) from its origin."""
    sign = 1.0 if up else -1.0
    body.mass = part.mass * mass
    body.ipos = [0.0, 0.0, sign * (offset + part.centre * length)]
    body.inertia = [body.mass * (g * length) ** 2 for g in part.gyration]
    body.explicitinertial = True


def _hinge(
    spec: Any, body: Any, name: str, axis: Sequence[float], limits: tuple[float, float], size: BodySize,
    armature: float = 0.02, damping: float = 1.0,
) -> None:  # fmt: skip
    body.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=list(axis), range=list(limits), limited=1,
        armature=armature, damping=[damping, 0.0, 0.0],
    )  # fmt: skip
    torque = TORQUE_NM[name.removeprefix("l_").removeprefix("r_")] * size.strength
    motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.ctrlrange = [-torque, torque]
    motor.ctrllimited = 1


def _capsule(
    body: Any, name: str, start: Sequence[float], end: Sequence[float], radius: float, friction: float
) -> None:
    body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[radius, 0, 0], **_touching(friction)
    )


def _touching(friction: float, torsion: float = 0.005) -> dict[str, Any]:
    return {
        "contype": PERSON, "conaffinity": SURROUNDINGS, "mass": 0.0, "condim": 4 if torsion > 0.01 else 3,
        "friction": [friction, torsion, 0.0001],
    }  # fmt: skip
