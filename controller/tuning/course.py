"""The risk of a whole case under given thresholds: `KnownRisk` for all turns at once.

`assess_risk` and `KnownRisk` say what the risk is; here the same is computed for every horizon and every turn
of a recording together, because a study asks for it some hundred times. A test holds the two against each other.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.messages import STEPS, Floats
from controller.intervention.risk import ramp, time_to_boundary
from controller.tuning.cases import Case, Horizons, Ints
from controller.tuning.watching import Watched, held, values, watch

BLOCK: Final = 1 << 15  # turns at a time: hours of recording must not need gigabytes


class Stages(NamedTuple):
    """The prediction that the stiffening is made for."""

    stages: int = 20
    stage_s: float = 0.025

    @property
    def ahead_s(self) -> Floats:
        """Time of each stage from now on, (N,) [s]."""
        return np.linspace(0.0, (self.stages - 1) * self.stage_s, self.stages)


class Inputs(NamedTuple):
    """The three inputs at every turn; depends on the limits of age alone."""

    horizon: Watched
    wrench: Watched | None
    odometry: Watched | None
    faulty: NDArray[np.bool_]  # (T,)
    load_n: Floats  # (T,)
    descent_m_s: Floats  # (T,)


class Course(NamedTuple):
    """Risk at every turn; each (T,), 0..1."""

    now: Floats  # at this moment
    near: Floats  # largest within `arrest_reach_s`
    ahead: Floats  # largest over the stages
    wanted: Floats  # stiffening that must be begun with now, so that a rise is up in time


class Curves(NamedTuple):
    """Which horizon counts at every turn."""

    newest: Ints  # (T,) newest good horizon, -1 before the first
    start_ns: Ints  # (T,) where its step 0 lies on the reader's clock
    trusted: Ints  # (T,) newest good horizon of trusted quality, -1 before the first
    trusted_start_ns: Ints  # (T,)


def inputs(case: Case, supervisor: SupervisorConfig) -> Inputs:
    """Return what the controller knows of its inputs at every turn."""
    times_ns, count = case.times_ns, case.ticks
    horizon = watch(case.horizons.stream, times_ns, supervisor.horizon_age_limit_s)
    faulty = horizon.faulty
    wrench = odometry = None
    load_n = descent_m_s = np.zeros(count)
    if case.pull is not None:
        wrench = watch(case.pull.stream, times_ns, supervisor.wrench_age_limit_s)
        faulty, load_n = faulty | wrench.faulty, values(case.pull.value, wrench)
    if case.descent is not None:
        odometry = watch(case.descent.stream, times_ns, supervisor.odometry_age_limit_s)
        faulty, descent_m_s = faulty | odometry.faulty, values(case.descent.value, odometry)
    return Inputs(horizon, wrench, odometry, faulty, load_n, descent_m_s)


def risks(horizons: Horizons, config: InterventionConfig) -> Floats:
    """Return the risk of each step of each horizon, (M, 16): `assess_risk` for all, and `KnownRisk`'s doubt."""
    distance, rate, probabilities = horizons.distance, horizons.distance_rate, horizons.probabilities
    steps = max(config.steps_used, 1)
    if steps < STEPS:  # as `looked_at`
        index = np.minimum(np.arange(STEPS), steps - 1)
        distance, probabilities = distance[:, index], probabilities[:, index]
        rate = np.gradient(distance, axis=1) / horizons.step_s[:, None] if len(distance) else distance
    stable, fall = probabilities[:, :, 0], probabilities[:, :, 2]
    with np.errstate(invalid="ignore"):  # horizons that nobody may use hold anything
        by_probability = ramp(fall, config.probability_onset, config.probability_full)
        most = np.maximum(config.unconfirmed_most, by_probability.max(axis=1, keepdims=True, initial=0.0))
        credible = ramp(1.0 - stable, config.credible_onset, config.credible_full)
        by_distance = credible * ramp(distance, config.distance_onset_sd, config.distance_full_sd)
        soon = ramp(time_to_boundary(distance, rate), config.approach_onset_s, config.approach_full_s)
        near = ramp(distance, config.approach_far_sd, config.approach_near_sd)
        seen = np.minimum(np.maximum(by_distance, credible * soon * near), most)
        risk: Floats = np.maximum(seen, by_probability)
    doubtful = horizons.quality < config.trusted_quality
    risk[doubtful] = np.minimum(risk[doubtful], config.unconfirmed_most)
    return risk


def curves(case: Case, known: Inputs, config: InterventionConfig) -> Curves:
    """Return which horizon counts at every turn, and which one was last trusted."""
    times_ns, horizons = case.times_ns, case.horizons
    newest = known.horizon.good
    at = np.maximum(newest, 0)
    if not len(horizons.stream):
        nothing = np.zeros(case.ticks, np.int64)
        return Curves(newest, nothing, newest, nothing)
    first_turn = np.searchsorted(times_ns, horizons.stream.arrival_ns[at], side="left")
    start_ns = np.minimum(horizons.stream.stamp_ns[at], times_ns[np.minimum(first_turn, case.ticks - 1)])
    last = held((newest >= 0) & (horizons.quality[at] >= config.trusted_quality))
    trusted = np.where(last >= 0, newest[np.maximum(last, 0)], -1)
    return Curves(newest, start_ns, trusted, start_ns[np.maximum(last, 0)])


def course(
    case: Case,
    which: Curves,
    intervention: InterventionConfig,
    supervisor: SupervisorConfig,
    stages: Stages,
) -> Course:
    """Return the risk of `case` at every turn."""
    parts = Course(*(np.zeros(case.ticks) for _ in Course._fields))
    if intervention.steps_used == 0:
        return parts
    table, ahead_s, times_ns = risks(case.horizons, intervention), stages.ahead_s, case.times_ns
    near = int(np.count_nonzero(ahead_s <= supervisor.arrest_reach_s))
    climb = intervention.rise_per_s * stages.stage_s * np.arange(stages.stages)
    peak = table.max(axis=1, initial=0.0)
    at = np.maximum(which.newest, 0)
    sure = which.newest == which.trusted
    quiet = (which.newest >= 0) & sure & (peak[at] == 0.0 if len(peak) else False)
    busy = np.flatnonzero(~quiet)
    for begin in range(0, len(busy), BLOCK):
        turns = busy[begin : begin + BLOCK]
        risk = _ahead(case, table, which, turns, times_ns[turns], ahead_s, intervention)
        parts.now[turns] = risk[:, 0]
        parts.near[turns] = risk[:, :near].max(axis=1)
        parts.ahead[turns] = risk.max(axis=1)
        parts.wanted[turns] = np.maximum((risk - climb).max(axis=1), 0.0)
    return parts


def _ahead(
    case: Case,
    table: Floats,
    which: Curves,
    turns: Ints,
    now_ns: Ints,
    ahead_s: Floats,
    config: InterventionConfig,
) -> Floats:
    """Return the risk at each stage of some turns, (K, N): `KnownRisk.ahead`."""
    newest, trusted = which.newest[turns], which.trusted[turns]
    if not len(table):
        return np.full((len(turns), len(ahead_s)), config.unknown_risk)
    age_s = (now_ns - which.start_ns[turns]) / NS
    risk = _read(table, case.horizons.step_s, np.maximum(newest, 0), age_s, ahead_s)
    doubtful = np.flatnonzero(newest != trusted)
    if len(doubtful):
        trusted_age_s = (now_ns - which.trusted_start_ns[turns])[doubtful] / NS
        at = np.maximum(trusted[doubtful], 0)
        remembered = _read(table, case.horizons.step_s, at, trusted_age_s, ahead_s)
        lapsed = (trusted[doubtful] < 0) | (trusted_age_s > config.unknown_hold_s)
        remembered[lapsed] = config.unknown_risk
        risk[doubtful] = np.maximum(risk[doubtful], remembered)
    risk[newest < 0] = config.unknown_risk
    return risk


def _read(table: Floats, step_s: Floats, at: Ints, age_s: Floats, ahead_s: Floats) -> Floats:
    """Return rows of `table` at `age_s` + `ahead_s`, straight between its steps and held past both ends."""
    place = np.clip((ahead_s + age_s[:, None]) / step_s[at, None], 0.0, STEPS - 1.0)
    lower = np.minimum(place.astype(np.int64), STEPS - 2)
    begin = np.take_along_axis(table[at], lower, axis=1)
    end = np.take_along_axis(table[at], lower + 1, axis=1)
    read: Floats = begin + (place - lower) * (end - begin)
    return read
