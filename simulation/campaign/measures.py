"""From the trace of a trial to its numbers.

The descent begins when the pelvis was last not on its way down before it is 4 cm below where it walked. The
first stiffening is the beginning of the rise that was up when the descent was arrested, or else of the first after the
disturbance. Leads are positive when what they count came before the descent.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import nan
from typing import Any, Final

import numpy as np

from bridge.messages import Floats, GaitState
from simulation.campaign.trace import STATES, Trace
from simulation.scenarios.arrest import ALLOWED_DROP_M, TIPPED_RAD
from simulation.scenarios.scenario import Scenario

STIFF: Final = 0.2  # stiffening that a person feels
LOW_M: Final = 0.04  # below walking height: a descent
COMING_DOWN_M_S: Final = 0.1
SEEN: Final = 0.5  # probability of fall that counts as seen or foreseen
HUNG_S: Final = 0.5  # with more than half of the weight in the harness: nobody does that on purpose for so long
QUIET_S: Final = 3.0  # free walking is judged from here on: the stack is up and the person walks
ARREST, GUARD, STOP = (float(STATES.index(s)) for s in (GaitState.ARREST, GaitState.GUARD, GaitState.SAFE_STOP))


@dataclass(frozen=True, slots=True)
class Measures:
    """Numbers of one trial. Times [s]; NaN where a thing did not happen."""

    pelvis_drop_m: float  # from standing height, or from as low as the person meant to come
    touched: bool
    arrested_fall: bool  # a fall, held: little drop and no knee, thigh, pelvis, trunk or head on the floor
    peak_force_n: float  # size of the interface force after the disturbance
    peak_force_weights: float  # the same in body weights
    peak_rate_n_s: float  # fastest change of that force, over 20 ms
    tilt_rad: float
    tipped: bool
    hung_s: float  # longest time with more than half of the weight in the harness
    arrests: int
    guards: int
    stops: int
    arrest_s: float  # from the disturbance to the first ARREST after it
    descent_s: float  # from the disturbance to the beginning of the descent
    lead_s: float  # from the first stiffening to the descent
    unsteady_lead_s: float  # from the first horizon whose present step is not stable to the descent
    seen_lead_s: float  # from the first horizon with a fall in the present step to the descent
    foreseen_lead_s: float  # from the first horizon with a fall in any step to the descent
    false_unsteady: int  # horizons before the disturbance whose present step is not stable
    false_foreseen: int  # horizons before the disturbance with a fall in any step
    walked_m: float
    rms_force_n: float  # horizontal, in free walking; NaN where nobody walked
    energy_j_m: float  # that the person spends on the walker for a metre of free walking

    @property
    def went_down(self) -> bool:
        """Whether the person came to lie or to hang, whatever the scenario meant to be."""
        return self.touched or self.hung_s >= HUNG_S

    def row(self) -> dict[str, Any]:
        """Return the numbers by name."""
        return asdict(self)


def measure(scenario: Scenario, trace: Trace, disturbed_s: float | None, standing_m: float) -> Measures:
    """Return the numbers of a trial of `scenario`.

    Args:
        scenario: what was performed.
        trace: what was noted.
        disturbed_s: when the first disturbance began [s]; None if there was none.
        standing_m: height of the pelvis in standing [m].
    """
    is_fall, t = scenario.kind == "fall", trace.time_s
    began_s = disturbed_s if disturbed_s is not None else (nan if is_fall else QUIET_S)
    after = t >= began_s
    size = np.linalg.norm(trace.force_n, axis=1)
    floor = standing_m - scenario.lowered_m
    low = float(np.min(trace.pelvis_m, where=after, initial=np.inf))
    drop = floor - low if after.any() else nan
    touched = bool(trace.touched[-1])
    descent = _descent(trace, began_s, floor)
    tilt = float(trace.tilt_rad.max())
    quiet = (t >= QUIET_S) & (~after if disturbed_s is not None else True)
    walked = float(np.ptp(trace.walked_m[quiet])) if quiet.any() else 0.0
    free = walked > 0.15
    horizontal = trace.force_n[:, 0] ** 2 + trace.force_n[:, 1] ** 2
    peak = float(np.max(size, where=after, initial=0.0))
    return Measures(
        pelvis_drop_m=drop,
        touched=touched,
        arrested_fall=is_fall and not touched and drop <= ALLOWED_DROP_M,
        peak_force_n=peak,
        peak_force_weights=peak / (9.81 * scenario.size.mass_kg),
        peak_rate_n_s=float(np.max(np.abs(size[5:] - size[:-5]) / 0.02, where=after[5:], initial=0.0)),
        tilt_rad=tilt,
        tipped=tilt > TIPPED_RAD,
        hung_s=_longest(t, -trace.force_n[:, 2] > 0.5 * 9.81 * scenario.size.mass_kg),
        arrests=_entries(trace.state, ARREST),
        guards=_entries(trace.state, GUARD),
        stops=_entries(trace.state[t > 1.5], STOP),
        arrest_s=_first(t, after & (trace.state == ARREST)) - began_s,
        descent_s=descent - began_s,
        lead_s=descent - _stiffened(trace, began_s, descent),
        unsteady_lead_s=descent - _first(trace.horizon_s, (trace.horizon_s >= began_s) & (trace.unsteady_now >= SEEN)),
        seen_lead_s=descent - _first(trace.horizon_s, (trace.horizon_s >= began_s) & (trace.falls_now >= SEEN)),
        foreseen_lead_s=descent - _first(trace.horizon_s, (trace.horizon_s >= began_s) & (trace.falls_ahead >= SEEN)),
        false_unsteady=int(np.count_nonzero((trace.horizon_s < began_s) & (trace.unsteady_now >= SEEN))),
        false_foreseen=int(np.count_nonzero((trace.horizon_s < began_s) & (trace.falls_ahead >= SEEN))),
        walked_m=walked,
        rms_force_n=float(np.sqrt(np.mean(horizontal[quiet]))) if free else nan,
        energy_j_m=float(np.sum(np.maximum(trace.power_w[quiet], 0.0)) * (t[1] - t[0]) / walked) if free else nan,
    )


def _descent(trace: Trace, began_s: float, floor_m: float) -> float:
    """Return when the pelvis began to come down for good [s]."""
    low = (trace.time_s >= began_s) & (trace.pelvis_m < floor_m - LOW_M)
    if not low.any():
        return nan
    first = int(np.argmax(low))
    resting = np.flatnonzero(trace.pelvis_speed_m_s[:first] > -COMING_DOWN_M_S)
    return float(trace.time_s[resting[-1]]) if len(resting) else float(trace.time_s[0])


def _stiffened(trace: Trace, began_s: float, descent_s: float) -> float:
    """Return when the first stiffening after the disturbance began [s]."""
    stiff = trace.stiffening >= STIFF
    after = np.flatnonzero((trace.time_s >= began_s) & stiff)
    if not len(after) or np.isnan(descent_s):
        return nan
    held = int(after[0])
    while held > 0 and stiff[held - 1] and trace.time_s[held - 1] >= began_s:
        held -= 1
    return float(trace.time_s[held])


def _longest(times: Floats, holds: Any) -> float:
    """Return for how long `holds` was true without a break, at most [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], holds.astype(np.int64), [0]))))
    spans = times[edges[1::2] - 1] - times[edges[::2]]
    return float(spans.max(initial=0.0))


def _first(times: Floats, holds: Any) -> float:
    where = np.flatnonzero(holds)
    return float(times[where[0]]) if len(where) else nan


def _entries(state: Floats, which: float) -> int:
    inside = (state == which).astype(np.int64)
    return int(np.count_nonzero(np.diff(inside, prepend=0) == 1))
