"""Which clips there are: scenarios drawn and tried as a campaign draws them, each with a help of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from bridge.config.surefoot import SurefootConfig
from bridge.messages import STEPS
from simulation.campaign.clips.record import Help, record
from simulation.scenarios.drawing import draw_checked
from simulation.scenarios.scenario import Kind

HELP_OF_FALLS: Final = {"none": 0.3, "reactive": 0.3, "early": 0.4}
HELP_OF_OTHERS: Final = {"none": 0.4, "reactive": 0.3, "needless": 0.3}
EARLY_S: Final = (0.0, 0.6)  # after the disturbance: from at once to when the harness' load speaks
NEEDLESS_S: Final = (2.0, 5.5)  # after the beginning
NEEDLESS_FOR_S: Final = 0.5


class ClipJob(NamedTuple):
    """One clip; plain values, so that it travels."""

    kind: Kind
    number: int
    seed: int
    folder: str
    config: SurefootConfig

    @property
    def path(self) -> Path:
        """Where the clip is written."""
        return Path(self.folder) / f"{self.kind}-{self.number:04d}.npz"


def drawn_help(kind: Kind, number: int, seed: int) -> Help:
    """Return what the walker does: nothing, wait for the load, or stiffen early, in a non-fall for nothing."""
    rng = np.random.default_rng([seed, number, kind == "fall", 1])
    shares = HELP_OF_FALLS if kind == "fall" else HELP_OF_OTHERS
    name = str(rng.choice(list(shares), p=list(shares.values())))
    if name == "early":
        return Help(name, STEPS, float(rng.uniform(*EARLY_S)))
    if name == "needless":
        return Help(name, STEPS, float(rng.uniform(*NEEDLESS_S)), NEEDLESS_FOR_S)
    return Help(name, 0 if name == "none" else 1)


def perform_clip(job: ClipJob) -> dict[str, Any]:
    """Record a clip, write it whole or not at all, and say what it was."""
    drawn = draw_checked(job.kind, job.number, job.seed)
    help_ = drawn_help(job.kind, job.number, job.seed)
    clip = record(drawn.scenario, help_, job.config, drawn.course.impact_s)
    partial = job.path.with_name(f".{job.path.name}.partial")
    with partial.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **clip)
    partial.replace(job.path)
    return {
        "name": job.path.name, "family": drawn.scenario.family, "title": drawn.scenario.title, "help": help_.name,
        "frames": len(clip["keypoints"]), "rejected_draws": drawn.rejected,
    }  # fmt: skip
