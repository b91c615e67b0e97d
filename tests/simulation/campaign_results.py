"""Made-up results of a campaign, for what does not need a simulated person."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from simulation.campaign.job import Job
from simulation.campaign.measures import Measures, measure
from simulation.campaign.trace import STATES, Trace
from simulation.person.anthropometry import BodySize
from simulation.scenarios.scenario import Scenario

STANDING_M = 0.9


def scenario(kind: str = "fall", lowered_m: float = 0.0) -> Scenario:
    return Scenario(
        title="made up", kind=kind, family="push", size=BodySize(1.7, 100.0), wishes=(), lowered_m=lowered_m
    )  # type: ignore[arg-type]


def trace(drop_m: float, stiff_s: float = np.inf, down_s: float = 1.2, touched: bool = False) -> Trace:
    """Return two seconds: down within 0.2 s from `down_s` on, stiff from `stiff_s` on."""
    t = np.arange(0.0, 2.0, 0.004)
    height = STANDING_M - drop_m * np.clip((t - down_s) / 0.2, 0.0, 1.0)
    hang = 1000.0 * np.clip((t - down_s - 0.1) / 0.1, 0.0, 1.0) * (drop_m > 0)
    zero = np.zeros_like(t)
    state = np.where(t >= stiff_s, float([s.value for s in STATES].index("ARREST")), 1.0)
    heard = np.arange(0.5, 2.0, 1 / 30)
    seen = (heard >= down_s + 0.3).astype(float)
    ahead = (heard >= down_s - 0.1).astype(float)
    return Trace(
        t, height, np.gradient(height, t), 0.5 * t, np.stack((zero, zero, -hang), axis=1), zero, zero, zero + 1.0,
        (t >= stiff_s).astype(float), state, (touched & (t > 1.5)).astype(float), heard, ahead, seen, ahead,
        3.0 - 4.0 * seen,
    )  # fmt: skip


def measured(drop_m: float, stiff_s: float = np.inf, **kwargs: Any) -> Measures:
    lowered = kwargs.pop("lowered_m", 0.0)
    kind = kwargs.pop("kind", "fall")
    return measure(scenario(kind, lowered), trace(drop_m, stiff_s, **kwargs), 1.0, STANDING_M)


def quick(job: Job) -> dict[str, Any]:
    """Stand in for the whole stack: numbers that depend on the job alone."""
    rng = np.random.default_rng([job.seed, job.number, job.kind == "fall"])
    drop = float(rng.uniform(0.02, 0.16)) if job.kind == "fall" else 0.0
    trials = {}
    for arm in job.arms:
        numbers = measured(drop, 1.25 if arm != "none" and job.kind == "fall" else np.inf, kind=job.kind)
        curves = {"time_s": [0.0, 1.0], "pelvis_m": [0.9, 0.8], "column_m": [1.0, 1.0], "force_n": [0.0, 1.0],
                  "stiffening": [0.0, 1.0], "state": [1.0, 3.0], "horizon_s": [0.5], "unsteady_now": [0.2],
                  "falls_now": [0.0], "falls_ahead": [0.1], "distance": [3.0]}  # fmt: skip
        trials[arm] = {"measures": numbers.row(), "failed_checks": [], "curves": curves}
    return {
        "name": job.name,
        "scenario": {
            "kind": job.kind, "number": job.number, "family": "push" if job.kind == "fall" else "walking",
            "title": "made up", "person_height_m": 1.7, "person_mass_kg": 100.0, "strength": 0.8, "event_s": 1.0,
            "blind_for_s": 0.0, "force_offset_n": [0.0, 0.0, 0.0], "rejected_draws": 1, "unassisted_descent_s": 0.6,
            "unassisted_impact_s": 1.2, "unassisted_impact_speed_m_s": 2.0,
        },
        "trials": trials,
    }  # fmt: skip


def slow(job: Job) -> dict[str, Any]:
    """Take long enough to be killed in the middle."""
    time.sleep(0.15)
    return quick(job)
