"""What wheels, floor, column and balance allow: linear limits on the walker's acceleration under a person's wrench.

With the reduced model `M a + n = Q + F`, Q the person's wrench and F what the drives add, along (x, y, yaw, height):

- wheel torque: `tau = (J^T)^+ (M a + n - Q)`, each within the motor's limit;
- traction: the horizontal force on the floor, without what only spins wheels, inside the friction circle
  (an octagon within it) of the load that rests on the floor;
- tip-over: the zero-moment point (Vukobratovic and Borovac 2004) of walker and wrench inside the wheels' rectangle
  less a margin, as moments, so that it stays linear: `m_x - x_s N <= 0`;
- column: `F_height` within the column's force, as limits on its acceleration.

Rows are scaled so that 1 is the machine's limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bridge.messages import Floats
from controller.walker import Walker, WalkerTerms

WHEEL_ROWS = slice(0, 4)
TRACTION_ROWS = slice(4, 8)
DRIVE_ROWS = slice(0, 8)
TIP_ROWS = slice(8, 12)
ROWS = 12
_COLUMN = slice(2 * ROWS + 3, None, 4)  # the column's two limits among all
# Part of the support rectangle given away so that the stated one is kept whole: by as much a plan may leave it.
SPARE = 0.03
_TIP_FRONT, _TIP_REAR, _TIP_LEFT, _TIP_RIGHT = 8, 9, 10, 11


class MachineBounds(NamedTuple):
    """Limits for the wrenches of `stages` instants: `low <= rows @ a <= high`, `box_low <= a <= box_high`."""

    low: Floats  # (stages, 12); -inf for tip-over
    high: Floats  # (stages, 12)
    box_low: Floats  # (stages, 4) [m/s^2, rad/s^2]
    box_high: Floats  # (stages, 4)


class MachineLimits:
    """Acceleration limits of a walker.

    Attributes:
        rows: (12, 4) four wheels' torque, four directions of traction, four tipping edges (front, rear, left, right).
        drive_map: (8, 3) what a force on the base (F_x, F_y, M_z) makes of wheels' torque and traction.
        drive_high: (8,) their limits without a person.
        edges: (4, 3) what the moments (N x_zmp, N y_zmp, N) make of the tipping rows.
        grip: part of the weight that grips whatever the column does.
        column_force: largest force of the column [N].
        acceleration: (4,) largest accelerations.
    """

    def __init__(self, walker: Walker, spare: float = SPARE) -> None:
        config = walker.config
        self._walker = walker
        self._weight = walker.weight
        stated = np.array([0.5 * config.wheelbase_m, 0.5 * config.track_m]) - config.support_margin_m
        self._half = (1.0 - spare) * stated
        self.column_force = config.column_force_max_n
        self.acceleration: Floats = np.array(config.acceleration_max)
        # The column's own acceleration may take this much load off the floor; the rest grips.
        self.grip = 1.0 - config.carriage_mass_kg * config.column_acceleration_max_m_s2 / self._weight
        self.drive_high: Floats = np.repeat([1.0, self.grip], 4)
        self._drive_low: Floats = -self.drive_high
        self._wheel_map: Floats = walker.wheel_force / config.wheel_torque_max_nm
        angles = np.pi / 8 + np.arange(4) * np.pi / 4
        # The octagon lies inside the circle: its faces are cos(22.5 deg) of the radius away.
        self._traction_map: Floats = np.stack([np.cos(angles), np.sin(angles)], axis=1) / (
            config.friction_coefficient * self._weight * np.cos(np.pi / 8)
        )
        self.drive_map: Floats = np.zeros((8, 3))
        self.drive_map[WHEEL_ROWS] = self._wheel_map
        self.drive_map[TRACTION_ROWS, :2] = self._traction_map
        self.rows: Floats = np.zeros((ROWS, 4))
        self.edges: Floats = np.zeros((4, 3))
        for edge in range(4):
            axis, sign = edge // 2, 1.0 - 2.0 * (edge % 2)
            self.edges[edge, axis] = sign / (self._weight * self._half[axis])
            self.edges[edge, 2] = -1.0 / self._weight
        # Limits without a wrench and their change by a whole one, refilled at every step; tip-over has no lower limit.
        self._lines: Floats = np.zeros((2, 2 * ROWS + 8))
        self._at_none, self._slope = _parts(self._lines[0]), _parts(self._lines[1])
        self._at_none.low[TIP_ROWS] = -np.inf
        self._at_none.box_low[:], self._at_none.box_high[:] = -self.acceleration, self.acceleration
        self.linearise(walker.terms)

    def linearise(self, terms: WalkerTerms) -> None:
        """Set `rows` from the model's terms. Only tip-over varies, with the column's height."""
        self.rows[WHEEL_ROWS, :3] = self._wheel_map @ terms.mass[:3, :3]
        floor = terms.mass - self._walker.reflected
        self.rows[TRACTION_ROWS] = self._traction_map @ floor[:2]
        self.rows[TIP_ROWS] = self.edges @ moments_by_acceleration(terms)

    def bounds(self, terms: WalkerTerms, wrench: Floats, fading: Floats) -> MachineBounds:
        """Return the limits at instants at which `fading` (stages,) of `wrench` is left.

        Args:
            terms: the model now.
            wrench: (6,) force [N], then torque [N m], at the interface.
            fading: (stages,) from 0 to 1.
        """
        push = wrench @ terms.interface
        # What each row would carry at no acceleration, without the person and by the person.
        alone, by_person = self.drive_map @ terms.bias[:3], self.drive_map @ push[:3]
        resting, pushed = moments_at_rest(terms, self._weight, wrench)
        lifted = float(wrench[2]) / self._weight
        inertia = float(terms.mass[3, 3])
        force, load, hanging = (value / inertia for value in (self.column_force, float(terms.bias[3]), float(push[3])))

        # Every limit is a straight line over what is left of the wrench.
        at_none, slope = self._at_none, self._slope
        np.subtract(self._drive_low, alone, out=at_none.low[DRIVE_ROWS])
        np.subtract(self.drive_high, alone, out=at_none.high[DRIVE_ROWS])
        slope.low[DRIVE_ROWS] = slope.high[DRIVE_ROWS] = by_person
        slope.low[TRACTION_ROWS] += lifted
        slope.high[TRACTION_ROWS] -= lifted
        at_none.high[TIP_ROWS] = -(self.edges @ resting)
        slope.high[TIP_ROWS] = -(self.edges @ pushed)
        at_none.box_low[3], at_none.box_high[3] = -force - load, force - load
        slope.box_low[3] = slope.box_high[3] = hanging
        values = fading[:, None] * self._lines[1]
        values += self._lines[0]
        bounds = _parts(values)
        if min(self.grip, self.grip - lifted) < 0.0:
            # Less load than none grips nothing.
            missing = np.maximum(fading * lifted - self.grip, 0.0)[:, None]
            bounds.low[:, TRACTION_ROWS] -= missing
            bounds.high[:, TRACTION_ROWS] += missing
        column = values[:, _COLUMN]
        most = float(self.acceleration[3])
        np.minimum(np.maximum(column, -most, out=column), most, out=column)
        return bounds

    def give_way(self, terms: WalkerTerms, wrench: Floats, bounds: MachineBounds) -> Floats:
        """Return the (4,) acceleration nearest to rest that the machine can hold under the present `wrench` (6,).

        Zero in all ordinary cases. Where the person pushes harder than wheels or floor can resist it gives way
        until they can; where the push would tip the walker it moves under the push.
        """
        low, high = bounds.low[0], bounds.high[0]
        value = np.zeros(4)
        value[3] = min(max(0.0, float(bounds.box_low[0, 3])), float(bounds.box_high[0, 3]))
        if max(low.tolist()) <= 0.0 <= min(high.tolist()):
            return value
        middle = 0.5 * (low[DRIVE_ROWS] + high[DRIVE_ROWS])
        width = 0.5 * (high[DRIVE_ROWS] - low[DRIVE_ROWS])
        ratio = float(np.max(np.abs(middle) / np.maximum(width, 1e-3)))
        if ratio > 1.0:
            yielding = np.linalg.solve(terms.mass[:3, :3], (wrench @ terms.interface - terms.bias)[:3])
            value[:3] = (1.0 - 1.0 / ratio) * yielding
        for axis, fore, back in ((0, _TIP_FRONT, _TIP_REAR), (1, _TIP_LEFT, _TIP_RIGHT)):
            # Accelerating forward moves the zero-moment point back: the fore edge bounds from below.
            least, most = (
                float((high[row] - self.rows[row] @ value) / self.rows[row, axis] + value[axis]) for row in (fore, back)
            )
            value[axis] = min(max(float(value[axis]), least), most) if least <= most else 0.5 * (least + most)
        return np.clip(value, -self.acceleration, self.acceleration)


def _parts(values: Floats) -> MachineBounds:
    """Return views of the limits in `values` (..., 32)."""
    return MachineBounds(
        values[..., :ROWS],
        values[..., ROWS : 2 * ROWS],
        values[..., 2 * ROWS : 2 * ROWS + 4],
        values[..., 2 * ROWS + 4 :],
    )


def moments_by_acceleration(terms: WalkerTerms) -> Floats:
    """Return G (3, 4): what accelerations add to the moments (N x_zmp, N y_zmp) and the load N on the floor.

    With c the centre of mass, R = (R_x, R_y, N) the floor's reaction and L the angular momentum about c:
    `N x = c_x N - c_z R_x - L_y' + ((p - c) x f)_y + t_y`, and alike for y; R = P' + weight - f.
    """
    momentum, (x, y, z) = terms.momentum, terms.centre_of_mass
    G = np.empty((3, 4))
    G[0] = x * momentum[2] - z * momentum[0] - momentum[4]
    G[1] = y * momentum[2] - z * momentum[1] + momentum[3]
    G[2] = momentum[2]
    return G


def moments_at_rest(terms: WalkerTerms, weight_n: float, wrench: Floats) -> tuple[Floats, Floats]:
    """Return the same (3,) without acceleration: by the walker's weight and turning, and by a person's wrench (6,)."""
    x, y, z = terms.centre_of_mass.tolist()
    rate = terms.momentum_bias.tolist()
    px, py, pz = terms.interface_position.tolist()
    fx, fy, fz, tx, ty, _ = wrench.tolist()
    load = weight_n + rate[2]
    alone = np.array([x * load - z * rate[0] - rate[4], y * load - z * rate[1] + rate[3], load])
    return alone, np.array([pz * fx - px * fz + ty, pz * fy - py * fz - tx, -fz])
