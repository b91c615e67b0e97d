"""What became of the person, from a trace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simulation.scenarios.arrest import ALLOWED_DROP_M, TIPPED_RAD
from simulation.trial.trace import Trace


class Outcome(NamedTuple):
    """How a trial ended."""

    drop_m: float  # deepest pelvis below its mean height while walking undisturbed [m]
    peak_force_n: float  # at the interface [N]
    touched: bool  # whether knees, pelvis or trunk met the floor
    tipped: bool  # whether the walker's frame left the upright by more than 10 degrees

    @property
    def held(self) -> bool:
        """Whether the fall was arrested."""
        return self.drop_m <= ALLOWED_DROP_M and not self.touched and not self.tipped


def outcome_of(trace: Trace, event_s: float) -> Outcome:
    """Return the outcome of a trial whose disturbance came at `event_s`."""
    before = (trace.time_s > event_s - 3.0) & (trace.time_s < event_s)
    after = trace.time_s >= event_s
    standing = float(trace.pelvis_m[before, 2].mean())
    force = np.linalg.norm(trace.wrench[after, :3], axis=1)
    return Outcome(
        drop_m=standing - float(trace.pelvis_m[after, 2].min()),
        peak_force_n=float(force.max()),
        touched=bool(trace.touched[after].any()),
        tipped=bool(trace.tilt_rad[after].max() > TIPPED_RAD),
    )
