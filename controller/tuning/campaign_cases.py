"""Cases from a campaign: the trials that `surefoot campaign --record ARM` kept, with their falls beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from bridge.errors import SourceError
from bridge.record.layout import SUFFIX
from controller.tuning.recorded_cases import RecordingJob

PLAN: Final = "campaign.json"
RECORDINGS: Final = "recordings"


def is_campaign(folder: Path) -> bool:
    """Whether `folder` is that of a campaign."""
    return (folder / PLAN).is_file()


def campaign_jobs(folder: Path, called: str) -> list[RecordingJob]:
    """Return the recorded trials of a campaign in the order of their names.

    Raises:
        SourceError: the campaign kept no recordings.
    """
    found = sorted((folder / RECORDINGS).glob(f"*{SUFFIX}"))
    if not found:
        raise SourceError(
            f"{folder}: this campaign kept no recordings of its trials; run it with --record none into another folder"
        )
    return [RecordingJob(path, f"{called}:{path.name.removesuffix(SUFFIX)}") for path in found]
