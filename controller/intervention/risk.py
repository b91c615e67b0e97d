"""How close a fall is at each step of a horizon, in [0, 1], and in words."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bridge.config.intervention import InterventionConfig
from bridge.messages import STEPS, FallHorizon, Floats


class Risk(NamedTuple):
    """Risk of each step of a horizon with the cues it is the largest of; each (16,), in [0, 1]."""

    total: Floats
    by_distance: Floats
    by_approach: Floats
    by_probability: Floats


def looked_at(horizon: FallHorizon, steps: int) -> FallHorizon:
    """Return `horizon` as it is for who looks at its first `steps` (>= 1) alone: what lies beyond stays as the last.

    Rates are those of what is left: the present alone has none.
    """
    if steps >= STEPS:
        return horizon
    index = np.minimum(np.arange(STEPS), steps - 1)
    distance = horizon.distance[index]
    return replace(
        horizon,
        distance=distance,
        distance_rate=np.gradient(distance, horizon.step_s),
        probabilities=horizon.probabilities[index],
    )


def ramp(value: Floats, onset: float, full: float) -> Floats:
    """Return 0 up to `onset`, 1 from `full` on and the line between; `full` may lie below `onset`."""
    return (np.clip(value, min(onset, full), max(onset, full)) - onset) / (full - onset)


def time_to_boundary(distance: Floats, rate: Floats) -> Floats:
    """Return the time until `distance` is used up at `rate` [s]: 0 inside the boundary, inf where it is not closing."""
    closing = np.maximum(-rate, 0.0)
    with np.errstate(divide="ignore", over="ignore"):
        time = np.where(closing > 0.0, np.maximum(distance, 0.0) / np.where(closing > 0.0, closing, 1.0), np.inf)
    return np.where(distance <= 0.0, 0.0, time)


def assess_risk(horizon: FallHorizon, config: InterventionConfig) -> Risk:
    """Return the risk of each step of `horizon`.

    Three cues, each through its own thresholds: how near the fall boundary is, how soon it
    will be reached at the present rate (counted only within a distance where the rate means
    something), and how probable a fall is. Nearer, faster closing or more probable is never
    less risk. Quality is not part of it: see `KnownRisk`.

    The plane has two dimensions, the classifier has them all: somebody who bends down comes near
    the boundary. So distance and approach count only as far as the classifier does not call the step stable, and
    on their own, with no fall foreseen anywhere in the horizon, they stay below `unconfirmed_most`.
    """
    distance, rate = horizon.distance, horizon.distance_rate
    stable, fall = horizon.probabilities[:, 0], horizon.probabilities[:, 2]
    by_probability = ramp(fall, config.probability_onset, config.probability_full)
    credible = ramp(1.0 - stable, config.credible_onset, config.credible_full)
    most = max(config.unconfirmed_most, float(by_probability.max()))
    by_distance = np.minimum(credible * ramp(distance, config.distance_onset_sd, config.distance_full_sd), most)
    soon = ramp(time_to_boundary(distance, rate), config.approach_onset_s, config.approach_full_s)
    near = ramp(distance, config.approach_far_sd, config.approach_near_sd)
    by_approach = np.minimum(credible * soon * near, most)
    total = np.maximum(np.maximum(by_distance, by_approach), by_probability)
    return Risk(total, by_distance, by_approach, by_probability)


def describe(horizon: FallHorizon, risk: Risk, step: int, ahead_s: float) -> str:
    """Say what makes up the risk of `step`, which lies `ahead_s` ahead of now.

    For example 'fall boundary 0.4 sd away, closing at 3.1 sd/s, 130 ms (foreseen in 200 ms)'.
    """
    distance, rate = float(horizon.distance[step]), float(horizon.distance_rate[step])
    when = f" (foreseen in {ahead_s * 1e3:.0f} ms)" if ahead_s >= 0.5e-3 else ""
    if risk.by_probability[step] > max(risk.by_distance[step], risk.by_approach[step]):
        return f"fall probability {horizon.probabilities[step, 2]:.2f}{when}"
    if distance <= 0.0:
        return f"{-distance:.1f} sd past the fall boundary{when}"
    words = f"fall boundary {distance:.1f} sd away"
    if rate < 0.0:
        words += f", closing at {-rate:.1f} sd/s, {distance / -rate * 1e3:.0f} ms"
    return words + when
