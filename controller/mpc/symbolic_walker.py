"""The walker's model and limits as CasADi expressions: what `Walker` and `MachineLimits` compute, to be made C.

Pinocchio's wheel has no CasADi types, so the few terms that the limits need are written from the bodies it read
(Newton and Euler, body by body, in the base frame). A test holds every number to Pinocchio's. Yaw is the only rotation,
so a body's velocity does not depend on its height, and turning base axes add `w x v` to every acceleration.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from controller.machine_limits import DRIVE_ROWS, TIP_ROWS, TRACTION_ROWS, MachineLimits
from controller.walker import Walker


class SymbolicTerms(NamedTuple):
    """As `WalkerTerms`, in expressions."""

    mass: Any  # (4, 4)
    bias: Any  # (4,)
    momentum: Any  # (6, 4)
    momentum_bias: Any  # (6,)
    centre_of_mass: Any  # (3,)
    interface: Any  # (6, 4)
    interface_position: Any  # (3,)


class SymbolicLimits(NamedTuple):
    """As `MachineBounds`, with the acceleration that gives way."""

    low: Any  # (8, stages) drives
    high: Any  # (12, stages)
    column_low: Any  # (stages,) [m/s^2]
    column_high: Any  # (stages,)
    give_way: Any  # (4,)


def terms(walker: Walker, height: Any, velocity: Any) -> SymbolicTerms:
    """Return the model's terms at a column height [m] and a velocity (4,)."""
    bodies, interface = walker.bodies()
    up = ca.DM([0.0, 0.0, 1.0])
    turn = velocity[2] * up  # angular velocity of the base's axes
    total = sum(body.mass_kg for body in bodies)
    centres = [ca.DM(body.centre) + body.lifted * height * up for body in bodies]
    centre = sum((body.mass_kg * place for body, place in zip(bodies, centres, strict=True)), ca.SX.zeros(3)) / total

    mass, bias = ca.SX(ca.DM(walker.rotors)), ca.SX.zeros(4)
    momentum, momentum_bias = ca.SX.zeros(6, 4), ca.SX.zeros(6)
    for body, place in zip(bodies, centres, strict=True):
        moving = _moving(place, body.lifted)
        turning = ca.SX.zeros(3, 4)
        turning[1, :3] = ca.DM(body.spin).T
        turning[2, 2] = 1.0
        inertia = ca.DM(body.inertia)
        force = body.mass_kg * ca.cross(turn, moving @ velocity)
        torque = ca.cross(turn, inertia @ (turning @ velocity))
        weight = ca.DM([0.0, 0.0, body.mass_kg * walker.config.gravity_m_s2])
        mass += body.mass_kg * moving.T @ moving + turning.T @ inertia @ turning
        bias += moving.T @ (force + weight) + turning.T @ torque
        arm = ca.skew(place - centre)
        momentum[:3, :] += body.mass_kg * moving
        momentum[3:, :] += inertia @ turning + arm @ (body.mass_kg * moving)
        momentum_bias[:3] += force
        momentum_bias[3:] += torque + arm @ force

    position = ca.DM(interface) + height * up
    jacobian = ca.SX.zeros(6, 4)
    jacobian[:3, :] = _moving(position, 1.0)
    jacobian[5, 2] = 1.0
    return SymbolicTerms(mass, bias, momentum, momentum_bias, centre, jacobian, position)


def rows(walker: Walker, limits: MachineLimits, at: SymbolicTerms) -> Any:
    """Return the rows (12, 4) of `MachineLimits`."""
    drive_map = ca.DM(limits.drive_map)
    x, y, z = ca.vertsplit(at.centre_of_mass)
    linear, angular = at.momentum[:3, :], at.momentum[3:, :]
    moments = ca.vertcat(
        x * linear[2, :] - z * linear[0, :] - angular[1, :],
        y * linear[2, :] - z * linear[1, :] + angular[0, :],
        linear[2, :],
    )
    floor = at.mass - ca.DM(walker.reflected)
    result = ca.SX.zeros(12, 4)
    result[:4, :3] = drive_map[:4, :] @ at.mass[:3, :3]
    result[TRACTION_ROWS, :] = drive_map[TRACTION_ROWS, :2] @ floor[:2, :]
    result[TIP_ROWS, :] = ca.DM(limits.edges) @ moments
    return result


def bounds(
    walker: Walker, limits: MachineLimits, at: SymbolicTerms, machine_rows: Any, wrench: Any, fading: Any
) -> SymbolicLimits:
    """Return the limits under a person's wrench (6,) of which `fading` (stages,) is left, and what gives way to it."""
    fading = ca.DM(fading).T
    weight = walker.weight
    push = at.interface.T @ wrench
    drive_map = ca.DM(limits.drive_map)
    alone, by_person = drive_map @ at.bias[:3], drive_map @ push[:3]
    lifted = wrench[2] / weight
    grips = ca.DM.zeros(8)
    grips[TRACTION_ROWS] = 1.0
    missing = ca.fmax(fading * lifted - limits.grip, 0.0)  # less load than none grips nothing
    middle = -alone + by_person @ fading
    width = ca.DM(limits.drive_high) - grips @ (fading * lifted) + grips @ missing
    resting, pushed = _moments_at_rest(at, weight, wrench)
    tip = -(ca.DM(limits.edges) @ resting) - (ca.DM(limits.edges) @ pushed) @ fading
    inertia = at.mass[3, 3]
    hanging = (push[3] * fading - at.bias[3]) / inertia
    most, force = float(limits.acceleration[3]), limits.column_force / inertia
    low, high = middle - width, ca.vertcat(middle + width, tip)
    column_low = _clip(hanging - force, -most, most)
    column_high = _clip(hanging + force, -most, most)
    give_way = _give_way(limits, at, machine_rows, push, low[:, 0], high[:, 0], column_low[0], column_high[0])
    return SymbolicLimits(low, high, column_low, column_high, give_way)


def _give_way(
    limits: MachineLimits,
    at: SymbolicTerms,
    machine_rows: Any,
    push: Any,
    low: Any,
    high: Any,
    column_low: Any,
    column_high: Any,
) -> Any:
    """Return (4,) as `MachineLimits.give_way` does."""
    column = _clip(0.0, column_low, column_high)
    middle, width = 0.5 * (low + high[DRIVE_ROWS]), 0.5 * (high[DRIVE_ROWS] - low)
    ratio = ca.mmax(ca.fabs(middle) / ca.fmax(width, 1e-3))
    yielding = ca.solve(at.mass[:3, :3], push[:3] - at.bias[:3])
    share = ca.if_else(ratio > 1.0, 1.0 - 1.0 / ratio, 0.0)
    value = ca.vertcat(share * yielding, column)
    for axis, fore, back in ((0, 8, 9), (1, 10, 11)):
        least, most = (
            (high[row] - machine_rows[row, :] @ value) / machine_rows[row, axis] + value[axis] for row in (fore, back)
        )
        value[axis] = ca.if_else(least <= most, _clip(value[axis], least, most), 0.5 * (least + most))
    most = ca.DM(limits.acceleration)
    at_rest = ca.logic_and(ca.mmax(low) <= 0.0, ca.mmin(high) >= 0.0)
    resting = ca.vertcat(ca.SX.zeros(3), column)
    return ca.if_else(at_rest, resting, _clip(value, -most, most))


def _moments_at_rest(at: SymbolicTerms, weight: float, wrench: Any) -> tuple[Any, Any]:
    x, y, z = ca.vertsplit(at.centre_of_mass)
    px, py, pz = ca.vertsplit(at.interface_position)
    rate = at.momentum_bias
    load = weight + rate[2]
    fx, fy, fz, tx, ty, _ = ca.vertsplit(wrench)
    alone = ca.vertcat(x * load - z * rate[0] - rate[4], y * load - z * rate[1] + rate[3], load)
    return alone, ca.vertcat(pz * fx - px * fz + ty, pz * fy - py * fz - tx, -fz)


def _moving(place: Any, lifted: float) -> Any:
    """Return the Jacobian (3, 4) of a point's velocity."""
    result = ca.SX.zeros(3, 4)
    result[0, 0] = result[1, 1] = 1.0
    result[0, 2], result[1, 2], result[2, 3] = -place[1], place[0], lifted
    return result


def _clip(value: Any, low: Any, high: Any) -> Any:
    return ca.fmin(ca.fmax(value, low), high)
