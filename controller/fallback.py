"""What moves the walker when there is no plan: the clamped one-step law, and the controlled stop."""

from __future__ import annotations

import numpy as np

from bridge.messages import Floats
from controller.admittance import AdmittanceStages, one_step
from controller.machine_limits import DRIVE_ROWS, MachineBounds
from controller.motion_limits import MotionLimits, acceleration_to_rest


def fallback_acceleration(law: AdmittanceStages, force: Floats, velocity: Floats, span_s: float) -> Floats:
    """Return the (4,) acceleration that the admittance asks for now, without looking ahead or at limits."""
    return one_step(law.mass, law.damping[0], law.stiffness[0], force - law.load[0], velocity, span_s)


def stop_acceleration(velocity: Floats, limits: MotionLimits, span_s: float) -> Floats:
    """Return the (4,) acceleration of the controlled stop: base and column come to rest at their limits."""
    return acceleration_to_rest(velocity, limits, span_s)


def within_machine(wanted: Floats, give_way: Floats, rows: Floats, bounds: MachineBounds) -> Floats:
    """Return the acceleration nearest to `wanted` on the way from `give_way` that wheels, floor and balance allow.

    A limit that `give_way` itself breaks (nothing better is in reach) is opened as far as it needs, for the
    drives, and for tip-over left to get no worse.

    Args:
        wanted, give_way: (4,) accelerations.
        rows: (12, 4) rows of `MachineLimits`.
        bounds: limits under the present wrench; the first stage counts.
    """
    start: Floats = np.clip(give_way, bounds.box_low[0], bounds.box_high[0])
    step = np.clip(wanted, bounds.box_low[0], bounds.box_high[0]) - start
    at_start, along = rows @ start, rows @ step
    high = np.maximum(bounds.high[0], at_start)
    low = bounds.low[0].copy()
    low[DRIVE_ROWS] = np.minimum(low[DRIVE_ROWS], at_start[DRIVE_ROWS])
    share = 1.0
    for index in np.flatnonzero(np.abs(along) > 1e-9):
        room = (high[index] if along[index] > 0.0 else low[index]) - at_start[index]
        share = min(share, float(room / along[index]))
    result: Floats = start + max(share, 0.0) * step
    return result
