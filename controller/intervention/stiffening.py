"""The stiffening profile: what the risk asks for, at the rates a person can stand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bridge.messages import Floats


class Rates(NamedTuple):
    """How fast the stiffening may change [1/s]."""

    rise: float
    release: float


def stiffening_profile(present: float, asked: Floats, elapsed_s: float, stage_s: float, rates: Rates) -> Floats:
    """Return the stiffening s_k for now + k `stage_s`, k = 0..N-1; s_0 is the present one.

    The profile follows `asked` with |ds/dt| bounded by `rates`: between its stages, and between
    the present stiffening of the step before and s_0. A rise is begun so early that a stiffness
    foreseen for a later stage is reached there and not after it; only what cannot be
    reached even so comes late.

    Args:
        present: present stiffening of the step before, in [0, 1].
        asked: (N,) stiffening that the risk asks for at each stage, in [0, 1].
        elapsed_s: time since the step before [s].
        stage_s: time between two stages [s].
        rates: bounds of the rate of change.

    Returns:
        (N,) read-only, in [0, 1].
    """
    wanted: list[float] = asked.tolist()
    climb = rates.rise * stage_s
    for k in range(len(wanted) - 2, -1, -1):
        wanted[k] = max(wanted[k], wanted[k + 1] - climb)
    s, span_s = present, max(elapsed_s, 0.0)
    for k, target in enumerate(wanted):
        s = min(max(target, s - rates.release * span_s), s + rates.rise * span_s)
        wanted[k] = min(max(s, 0.0), 1.0)
        span_s = stage_s
    profile = np.array(wanted)
    profile.flags.writeable = False
    return profile
