"""From what the user names to cases: keypoint files, recordings, campaigns; in parallel, once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import joblib

from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.record.layout import METADATA_FILE, SUFFIX
from controller.tuning.cache import Cache
from controller.tuning.campaign_cases import campaign_jobs, is_campaign
from controller.tuning.cases import Case
from controller.tuning.clip_cases import ClipJob, clip_case, clip_jobs
from controller.tuning.falls import read_falls, with_falls
from controller.tuning.recorded_cases import RecordingJob, recording_case

CaseJob = ClipJob | RecordingJob
Told = Callable[[int, int, str], None]  # how many are done, of how many, and which was the last


def load_cases(
    words: Sequence[str],
    config: SurefootConfig,
    *,
    falls: Path | None = None,
    cache: Path | None = None,
    recompute: bool = False,
    jobs: int = 1,
    told: Told = lambda _done, _of, _name: None,
) -> list[Case]:
    """Return the cases that `words` name, in that order whatever `jobs` is.

    Args:
        words: an `.mcap` file, a rosbag2 folder, a folder of recordings, a campaign's folder, `FILE.npz`, or
            `FILE.npz:CLIP[/ARRAY]` with wildcards.
        config: of the nodes that make horizons out of keypoints, and of the controller's rate.
        falls: a list of falls (CSV) that overrides what is known of the recordings it names.
        cache: folder for what was computed; None: nothing is kept.
        recompute: compute horizons anew from the keypoints in recordings.
        jobs: how many at a time.
        told: is told of progress.

    Raises:
        SourceError: names what cannot be used and why.
    """
    listed = None if falls is None else read_falls(falls)  # a slip in it is said before the long part
    wanted = case_jobs(words, recompute=recompute)
    store = None if cache is None else Cache(cache, config)
    told(0, len(wanted), "")
    parallel = joblib.Parallel(n_jobs=min(jobs, len(wanted)), return_as="generator", batch_size=1)
    cases: list[Case] = []
    for case in parallel(joblib.delayed(_make)(job, config, store) for job in wanted):
        cases.append(case)
        told(len(cases), len(wanted), case.name)
    if falls is not None and listed is not None:
        cases = with_falls(cases, listed, falls)
    return cases


def case_jobs(words: Sequence[str], *, recompute: bool = False) -> list[CaseJob]:
    """Return what `words` name, without reading more than names.

    Raises:
        SourceError: something is not there, holds nothing, or is named twice.
    """
    jobs: list[CaseJob] = []
    for word in words:
        jobs.extend(_named(word, recompute=recompute))
    if not jobs:
        raise SourceError("no recordings were named")
    twice = [name for name, count in Counter(job.name for job in jobs).items() if count > 1]
    if twice:
        raise SourceError(f"{twice[0]} is named twice; rename a file if these are two")
    return jobs


def _named(word: str, *, recompute: bool) -> Sequence[CaseJob]:
    file, colon, clip = word.partition(".npz:")
    path = Path(file + ".npz" if colon else word)
    if path.suffix == ".npz":
        return clip_jobs(path, clip, path.name)
    if not path.exists():
        raise SourceError(f"{path}: no such recording, campaign or keypoint file")
    if not path.is_dir():
        return [RecordingJob(path, path.name, recompute=recompute)]
    if is_campaign(path):
        return campaign_jobs(path, path.name)
    if (path / METADATA_FILE).exists():
        return [RecordingJob(path, path.name, recompute=recompute)]
    found = sorted(path.glob(f"*{SUFFIX}"))
    if not found:
        raise SourceError(f"{path}: neither a campaign nor a folder with {SUFFIX} recordings")
    return [RecordingJob(file, file.name, recompute=recompute) for file in found]


def _make(job: CaseJob, config: SurefootConfig, cache: Cache | None) -> Case:
    if isinstance(job, RecordingJob):
        return recording_case(job, config)
    return clip_case(job, config) if cache is None else cache.clip_case(job, config)
