"""Where and how a fit is done: on which device, by how many processes, kept and logged where."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import torch

from anticipation.training.journal import Journal
from anticipation.training.log import Log
from anticipation.training.team import Team

CPU = torch.device("cpu")


@dataclass(frozen=True, slots=True)
class Run:
    """The surroundings of a fit; they change its speed and its traces, not its result."""

    device: torch.device = CPU
    team: Team = field(default_factory=Team)
    journal: Journal | None = None  # None: a killed fit is lost
    log: Log | None = None
    fit: str = ""  # name of the fit in journal and log

    def named(self, fit: str) -> Run:
        """Return the same surroundings for the fit of this name."""
        return replace(self, fit=fit)


ALONE = Run()
"""One process on the CPU that leaves no trace."""
