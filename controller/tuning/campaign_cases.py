"""Cases from a campaign: the trials that `surefoot campaign --record ARM` kept as recordings, and how they went."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from bridge.errors import SourceError
from bridge.record.layout import SUFFIX
from controller.tuning.cases import Fall
from controller.tuning.recorded_cases import RecordingJob

PLAN: Final = "campaign.json"
TRIALS: Final = "trials"
RECORDINGS: Final = "recordings"


def is_campaign(folder: Path) -> bool:
    """Whether `folder` is that of a campaign."""
    return (folder / PLAN).is_file()


def campaign_jobs(folder: Path, called: str) -> list[RecordingJob]:
    """Return the recorded trials of a campaign in the order of their names.

    A fall begins with the descent and is too late when the pelvis came down further than a harness allows, or touched
    the floor: both are in the trial's result. Daily deeds have no fall.

    Raises:
        SourceError: the campaign kept no recordings, or a result cannot be read.
    """
    found = sorted((folder / RECORDINGS).glob(f"*{SUFFIX}"))
    if not found:
        raise SourceError(
            f"{folder}: this campaign kept no recordings of its trials; run it with --record none into another folder"
        )
    jobs = []
    for path in found:
        scenario, _, arm = path.name.removesuffix(SUFFIX).rpartition(".")
        result = folder / TRIALS / f"{scenario}.json"
        try:
            trial: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))["trials"][arm]
            times = trial["times"]
            falls = (
                (Fall(float(times["descent_s"]), float(times["too_late_s"])),)
                if times["descent_s"] is not None and times["too_late_s"] is not None
                else ()
            )
        except FileNotFoundError:
            continue  # stopped between the two; the campaign does this scenario again
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SourceError(f"{result}: not a result of this campaign: {type(error).__name__}: {error}") from error
        jobs.append(RecordingJob(path, f"{called}:{scenario}.{arm}", falls))
    return jobs
