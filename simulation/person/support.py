"""From the wanted centre of pressure to forces under the feet, within what feet can do."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from bridge.messages import Floats

FRICTION = 0.7  # share of the vertical force a person dares to use horizontally


class Sole(NamedTuple):
    """The middle of a sole on the floor and its half sizes along the heading and across."""

    x: float
    y: float
    half_length: float
    half_width: float

    def nearest(self, x: float, y: float, heading: tuple[float, float]) -> tuple[float, float]:
        """Return the point of the sole nearest to (x, y) [m]."""
        c, s = heading
        dx, dy = x - self.x, y - self.y
        along = min(max(c * dx + s * dy, -self.half_length), self.half_length)
        across = min(max(c * dy - s * dx, -self.half_width), self.half_width)
        return self.x + c * along - s * across, self.y + s * along + c * across


class Stance(NamedTuple):
    """Share of the load and centre of pressure of each standing foot."""

    share: tuple[float, ...]
    pressure: tuple[tuple[float, float], ...]
    centre: tuple[float, float]  # of pressure, of all together


def wanted_pressure(
    dcm: tuple[float, float], reference: tuple[float, float], nominal: tuple[float, float], gain: float
) -> tuple[float, float]:
    """Return the centre of pressure that brings the DCM back to its reference [m]; gains above 1 do."""
    return nominal[0] + gain * (dcm[0] - reference[0]), nominal[1] + gain * (dcm[1] - reference[1])


def single_support(sole: Sole, wanted: tuple[float, float], heading: tuple[float, float]) -> Stance:
    """Return the stance on one foot."""
    point = sole.nearest(*wanted, heading)
    return Stance((1.0,), (point,), point)


def double_support(
    lead: Sole, trail: Sole, wanted: tuple[float, float], heading: tuple[float, float], least_on_lead: float
) -> Stance:
    """Return the stance on two feet: the load moves along the line between them, the rest is left to the soles."""
    ex, ey = lead.x - trail.x, lead.y - trail.y
    along = ((wanted[0] - trail.x) * ex + (wanted[1] - trail.y) * ey) / max(ex * ex + ey * ey, 1e-6)
    on_lead = max(min(max(along, 0.02), 0.98), least_on_lead)
    rest_x = wanted[0] - trail.x - on_lead * ex
    rest_y = wanted[1] - trail.y - on_lead * ey
    first = lead.nearest(lead.x + rest_x, lead.y + rest_y, heading)
    second = trail.nearest(trail.x + rest_x, trail.y + rest_y, heading)
    other = 1.0 - on_lead
    return Stance(
        (on_lead, other),
        (first, second),
        (on_lead * first[0] + other * second[0], on_lead * first[1] + other * second[1]),
    )


def ground_force(
    centre_of_mass: Floats,
    height: float,
    pressure: tuple[float, float],
    vertical: float,
    moment: tuple[float, float],
) -> Floats:
    """Return the ground reaction force (3,) [N] through `pressure`.

    The part along the line to the centre of mass makes the pendulum; what passes beside it turns the trunk: a moment
    (M_x, M_y) about the centre of mass takes the horizontal force (-M_y, M_x) / h.
    """
    fx = vertical / height * (float(centre_of_mass[0]) - pressure[0]) - moment[1] / height
    fy = vertical / height * (float(centre_of_mass[1]) - pressure[1]) + moment[0] / height
    size, most = hypot(fx, fy), FRICTION * vertical
    if size > most:
        fx, fy = fx * most / size, fy * most / size
    return np.array([fx, fy, vertical])
