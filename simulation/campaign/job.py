"""One piece of a campaign's work: a scenario, drawn and tried out without help, then performed in every arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

from bridge.config.surefoot import SurefootConfig
from bridge.record.layout import SUFFIX
from simulation.campaign.checks import failed
from simulation.campaign.measures import Measures
from simulation.campaign.trace import Trace
from simulation.campaign.trial import run_trial
from simulation.scenarios.drawing import Drawn, draw_checked
from simulation.scenarios.scenario import Kind

EVERY: Final = 5  # turns between two points of a kept curve: 20 ms


class Job(NamedTuple):
    """What is to be done; plain values, so that it travels."""

    kind: Kind
    number: int
    seed: int
    arms: tuple[str, ...]
    config: SurefootConfig
    recorded: str = ""  # arm whose trials are kept as recordings
    recordings: Path = Path()  # where

    @property
    def name(self) -> str:
        """Name of the result, such as 'fall-0007'."""
        return f"{self.kind}-{self.number:04d}"


def perform(job: Job) -> dict[str, Any]:
    """Return the result of `job` as plain values: the scenario, and the numbers and curves of each arm."""
    drawn, alone = _drawn(job)
    scenario, course = drawn.scenario, drawn.course
    trials: dict[str, Any] = {}
    for arm in job.arms:
        keep = job.recordings / f"{job.name}.{arm}{SUFFIX}" if arm == job.recorded else None
        done = alone if arm == "none" and keep is None else None
        measures, trace = done or run_trial(scenario, arm, job.config, keep)
        trials[arm] = {
            "measures": measures.row(), "failed_checks": failed(scenario, measures), "curves": _curves(trace),
        }  # fmt: skip
    return {
        "name": job.name,
        "scenario": {
            "kind": scenario.kind,
            "number": job.number,
            "family": scenario.family,
            "title": scenario.title,
            "person_height_m": scenario.size.height_m,
            "person_mass_kg": scenario.size.mass_kg,
            "strength": scenario.ability.strength,
            "event_s": min((each.at_s for each in scenario.disturbances), default=None),
            "blind_for_s": scenario.faults.blind_for_s,
            "force_offset_n": list(scenario.faults.force_offset_n),
            "rejected_draws": drawn.rejected,
            "unassisted_descent_s": course.descent_s,
            "unassisted_impact_s": course.impact_s,
            "unassisted_impact_speed_m_s": course.impact_speed_m_s,
        },
        "trials": trials,
    }


def _drawn(job: Job) -> tuple[Drawn, tuple[Measures, Trace] | None]:
    """Return a draw that is what it claims to be, and for a non-fall its trial in the walker without intervention.

    Who stays up alone may still fall over the walker that follows: that is a fall, and no arrest of it is needless.
    """
    drawn = draw_checked(job.kind, job.number, job.seed)
    if job.kind == "fall":
        return drawn, None
    while True:
        alone = run_trial(drawn.scenario, "none", job.config)
        if not alone[0].went_down:
            return drawn, alone
        drawn = draw_checked(job.kind, job.number, job.seed, drawn.rejected + 1)


def _curves(trace: Trace) -> dict[str, list[float]]:
    part = slice(None, None, EVERY)
    force = (trace.force_n**2).sum(axis=1) ** 0.5
    columns = {
        "time_s": trace.time_s, "pelvis_m": trace.pelvis_m, "column_m": trace.column_m, "force_n": force,
        "stiffening": trace.stiffening, "state": trace.state,
    }  # fmt: skip
    curves = {name: [round(float(v), 4) for v in column[part]] for name, column in columns.items()}
    heard = {
        "horizon_s": trace.horizon_s, "unsteady_now": trace.unsteady_now, "falls_now": trace.falls_now,
        "falls_ahead": trace.falls_ahead, "distance": trace.distance,
    }  # fmt: skip
    for name, column in heard.items():
        curves[name] = [round(float(v), 3) for v in column]
    return curves
