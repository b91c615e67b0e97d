"""Whether a person and a rendered mass and damper begin to swing together.

The walker makes the motion `M a + D v = f` later by the loop's delay tau (sensor, period, drive); padding,
harness and the body behind it push back like a spring k. The loop

    L(s) = k e^{-tau s} / (s (M s + D))

has gain 1 at `w^2 = (sqrt(D^4 + 4 M^2 k^2) - D^2) / (2 M^2)`; it is stable while its phase there is above -180
degrees, `w tau + atan(w M / D) < pi / 2`: for a light damper about `D > k tau`. The coupling's own damping only helps
and is not counted. For loops of this kind see Keemink, van der Kooij and Stienen 2018, "Admittance control for physical
human-robot interaction", Int. J. Robotics Research 37.
"""

from __future__ import annotations

import numpy as np

from bridge.messages import Floats


def phase_margin(mass: Floats, damping: Floats, stiffness: float, delay_s: float) -> Floats:
    """Return by how much the coupled loop is stable, negative where it swings [rad].

    Args:
        mass: (P,) rendered mass [kg], or inertia [kg m^2].
        damping: (P,) rendered damping [N s/m], or [N m s/rad].
        stiffness: that a person is coupled with [N/m], or [N m/rad].
        delay_s: from a force to the motion it causes [s].
    """
    # as 2 k^2 / (...): the difference of two large numbers would lose its digits for a light mass
    crossover = np.sqrt(2.0 * stiffness**2 / (np.sqrt(damping**4 + 4.0 * (mass * stiffness) ** 2) + damping**2))
    result: Floats = 0.5 * np.pi - crossover * delay_s - np.arctan(crossover * mass / damping)
    return result


def coasting_s(mass: Floats, damping: Floats) -> Floats:
    """Return the time constant with which the walker goes on when nobody pushes any more, M / D [s]."""
    result: Floats = mass / damping
    return result
