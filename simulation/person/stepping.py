"""When and where to step: the divergent component of motion (DCM) of a linear inverted pendulum.

xi = c + c' / omega, omega = sqrt(g / h), diverges from the centre of pressure p as xi' = omega (xi - p). A step that
begins with xi at p + b ends with it at p + b e^{omega T}: putting the next foot at xi(T) - b keeps the motion
periodic. J. Englsberger et al., 'Three-dimensional bipedal walking control based on divergent component of motion',
IEEE T-RO 31(2), 2015; step adaptation as in M. Khadiv et al., 'Walking control based on step timing adaptation',
IEEE T-RO 36(3), 2020.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import NamedTuple

from simulation.person.ability import Ability

SWING_S = 0.50  # a leg swings this long; slower walking stands longer on both legs
DOUBLE_SUPPORT_S = 0.12  # at least
DEEPEST_M = 0.025  # dip of the body


class Step(NamedTuple):
    """One step: from the touchdown of the standing foot to the touchdown of the next."""

    duration_s: float
    double_support_s: float  # at its beginning
    length_m: float  # forward, of the standing foot's advance in heading direction
    width_m: float  # distance of the feet, left to right

    def offset(self, omega: float, side: float) -> tuple[float, float]:
        """Return where the DCM is ahead of and beside a foot at its touchdown [m]; `side` 1 for a left standing foot.

        The next foot comes down on the other side, so the DCM lies on the inner side of it.
        """
        growth = exp(omega * self.duration_s)
        return self.length_m / (growth - 1.0), side * self.width_m / (growth + 1.0)


def plan_step(speed_m_s: float, height_m: float, width_m: float, ability: Ability) -> Step:
    """Return the step of steady walking at `speed_m_s`.

    Step length grows with speed to the power 0.42 (D. Grieve and R. Gear, 'The relationships between length of stride,
    step frequency, time of swing and speed of walking', Ergonomics 9(5), 1966), with 0.62 m at 1.2 m/s for 1.70 m.
    """
    pace = abs(speed_m_s)
    natural = 0.62 * height_m / 1.70 * (max(pace, 0.15) / 1.2) ** 0.42
    duration = min(max(natural / max(pace, 0.15), 0.45, ability.shortest_step_s), 1.10)
    return Step(duration, max(DOUBLE_SUPPORT_S, duration - SWING_S), speed_m_s * duration, width_m)


def foothold(wanted: tuple[float, float], side: float, height_m: float, ability: Ability) -> tuple[float, float]:
    """Return the foothold (forward, left) of the standing foot nearest to `wanted` that the person can reach [m].

    `side` is 1 while the left foot stands: the right one is then put down to its right.
    """
    forward = min(max(wanted[0], -ability.step_back * height_m), ability.step_forward * height_m)
    apart = min(max(-side * wanted[1], ability.step_narrow * height_m), ability.step_wide * height_m)
    return forward, -side * apart


class Bob(NamedTuple):
    """The body's rise and fall in walking."""

    low_m: float  # below its height over the standing foot
    sinking_m_s: float
    upward_m_s2: float


def dip(ahead_m: float, leg_m: float, standing: float, landing: float) -> float:
    """Return how much lower the hips must be for the leg to reach `ahead_m` in front of them [m].

    `standing` and `landing` are lengths of the bent leg in shares of the stretched one, `leg_m`, below the hips and at
    touchdown: an inverted pendulum's arc, flattened by the knees.
    """
    reach = landing * leg_m
    low = standing * leg_m - sqrt(max(reach * reach - max(ahead_m, 0.0) ** 2, 0.0))
    return min(max(low, 0.0), DEEPEST_M)


def bob(deep_m: float, since_lowest_s: float, step_s: float) -> Bob:
    """Return the wave of one step, lowest in double support and highest over the standing foot."""
    rate = 2.0 * pi / step_s
    half, turn = 0.5 * deep_m, rate * since_lowest_s
    return Bob(half * (1.0 + cos(turn)), -half * rate * sin(turn), half * rate * rate * cos(turn))
