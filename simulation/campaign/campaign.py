"""A campaign from plan to report: what is missing is done, what is there is kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from simulation.campaign.arms import ARMS
from simulation.campaign.job import Job, perform
from simulation.campaign.recordings import FOLDER
from simulation.campaign.report import parquet, report
from simulation.campaign.store import Store
from simulation.campaign.workers import work

Told = Callable[[int, int], None]  # how many scenarios are done, of how many


class Plan(NamedTuple):
    """What a campaign consists of."""

    falls: int
    non_falls: int
    seed: int
    config: SurefootConfig
    arms: tuple[str, ...] = ARMS
    recorded: str = ""  # arm whose trials are kept as recordings; '' for none

    def jobs(self) -> list[Job]:
        """Return the pieces of work, falls and non-falls in turn.

        Raises:
            ConfigError: an arm is unknown, or there is nothing to do.
        """
        for arm in self.arms:
            if arm not in ARMS:
                raise ConfigError(f"arm {arm}: known: {', '.join(ARMS)}")
        if self.falls + self.non_falls < 1 or not self.arms:
            raise ConfigError("a campaign of no scenarios or no arms has no result")
        if self.recorded and self.recorded not in self.arms:
            raise ConfigError(f"--record {self.recorded}: no arm of this campaign ({', '.join(self.arms)})")
        jobs: list[Job] = []
        for number in range(max(self.falls, self.non_falls)):
            if number < self.falls:
                jobs.append(Job("fall", number, self.seed, self.arms, self.config))
            if number < self.non_falls:
                jobs.append(Job("non_fall", number, self.seed, self.arms, self.config))
        return jobs

    def described(self) -> dict[str, Any]:
        """Return what makes this campaign this one; how many workers do it does not."""
        text = self.config.model_dump_json()
        return {
            "falls": self.falls, "non_falls": self.non_falls, "seed": self.seed, "arms": list(self.arms),
            "config_sha256": hashlib.sha256(text.encode()).hexdigest(),
            **({"recorded": self.recorded} if self.recorded else {}),
        }  # fmt: skip


def run_campaign(
    plan: Plan,
    folder: Path,
    processes: int = 1,
    cluster: str = "",
    told: Told | None = None,
    performer: Callable[[Any], dict[str, Any]] = perform,
) -> dict[str, Any]:
    """Carry `plan` out in `folder` and return its summary; a campaign that was stopped goes on.

    Raises:
        SurefootError: the folder holds another campaign, a package is missing, or a job failed.
    """
    parquet()
    jobs = [job._replace(recorded=plan.recorded, recordings=folder.resolve() / FOLDER) for job in plan.jobs()]
    store = Store(folder, plan.described())
    missing = [job for job in jobs if not store.done(job.name)]
    done = len(jobs) - len(missing)
    tell = told or (lambda *_: None)
    tell(done, len(jobs))
    for result in work(performer, missing, processes, cluster):
        store.keep(result["name"], result)
        done += 1
        tell(done, len(jobs))
    return report(folder, plan.described(), _stored(store, jobs))


def _stored(store: Store, jobs: Sequence[Job]) -> list[dict[str, Any]]:
    # read back rather than kept: a campaign that was stopped and one that was not give the same bytes
    return [store.result(job.name) for job in jobs]
