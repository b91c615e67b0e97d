"""Cases from recordings: the horizons, wrenches and odometry that were on the wire, when they arrived."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import numpy as np

from bridge.clock import NS, nanoseconds
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.messages import FallHorizon, Odometry, Wrench
from bridge.record.layout import SUFFIX
from bridge.record.offline import replay_offline
from bridge.record.reader import Recording
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, WRENCH, Topic
from controller.tuning.cases import Case, Felt, horizons, stream
from controller.tuning.falls import checked, read_falls
from controller.tuning.judging import Judge, Judged

SIDECAR: Final = ".falls.csv"  # beside a recording: 'walk.falls.csv' for 'walk.mcap'
LONGEST_S: Final = 48 * 3600.0  # of one recording; a longer one has stamps of two clocks in it


class RecordingJob(NamedTuple):
    """One recording; plain values, so that it travels."""

    path: Path
    name: str
    recompute: bool = False  # horizons from the keypoints, also where the recording has some


def recording_case(job: RecordingJob, config: SurefootConfig) -> Case:
    """Return a recording as a case.

    Horizons are the recorded ones; without any they are computed from the recorded keypoints. Without a
    recorded wrench or odometry the walker is taken as unloaded or at rest.

    Raises:
        SourceError: no recording, or nothing in it that horizons could come from.
    """
    recording = Recording(job.path)
    wanted = (FALL_HORIZON, WRENCH, ODOMETRY, KEYPOINTS)
    samples: dict[str, list[Any]] = {topic.key: [] for topic in wanted}
    first_ns = last_ns = 0
    for recorded in recording.samples():
        first_ns, last_ns = first_ns or recorded.log_time_ns, recorded.log_time_ns
        if recorded.topic.key in samples:
            samples[recorded.topic.key].append(recorded.sample)
    seen = samples[FALL_HORIZON.key]
    if job.recompute or not seen:
        seen = _foreseen(recording, samples, config)
    if last_ns - first_ns > LONGEST_S * NS:
        raise SourceError(f"{job.path}: lasts {(last_ns - first_ns) / NS / 3600:.0f} h, limit {LONGEST_S / 3600:.0f}")
    period_ns = nanoseconds(1.0 / config.controller.rate_hz)
    horizon = _judged(FALL_HORIZON, seen, config)
    wrench, odometry = (_judged(topic, samples[topic.key], config) for topic in (WRENCH, ODOMETRY))
    case = Case(
        job.name,
        job.name,
        first_ns,
        period_ns,
        (last_ns - first_ns) // period_ns + 1,
        horizons(
            [cast(FallHorizon, one.message) for one in horizon], [one.arrival_ns for one in horizon],
            [one.fault for one in horizon], FALL_HORIZON.key,
        ),
        _felt(WRENCH, wrench, [-float(cast(Wrench, one.message).force[2]) for one in wrench]),
        _felt(ODOMETRY, odometry, [-float(cast(Odometry, one.message).velocity[2]) for one in odometry]),
    )  # fmt: skip
    return _with_falls(case, job.path)


def _foreseen(recording: Recording, samples: dict[str, list[Any]], config: SurefootConfig) -> list[Any]:
    """Return samples of the horizons that the recorded keypoints give."""
    if not samples[KEYPOINTS.key]:
        raise SourceError(f"{recording.path}: holds neither horizons nor keypoints")
    kept: list[Any] = []

    def keep(topic: Topic, sample: Any) -> None:
        if topic.key == FALL_HORIZON.key:
            kept.append(sample)

    replay_offline(recording, ["anticipation"], config, {}, keep)
    return kept


def _judged(topic: Topic, samples: Sequence[Any], config: SurefootConfig) -> list[Judged]:
    return Judge(topic, config.inputs.stuck_after_s).judge(samples)


def _felt(topic: Topic, judged: Sequence[Judged], value: Sequence[float]) -> Felt | None:
    if not judged:
        return None
    of = stream(
        topic.key, [one.arrival_ns for one in judged], [one.message.stamp_ns for one in judged],
        [one.fault for one in judged],
    )  # fmt: skip
    return Felt(of, np.array(value))


def _with_falls(case: Case, path: Path) -> Case:
    beside = path.with_name(path.name.removesuffix(SUFFIX) + SIDECAR)
    if not beside.exists():
        return replace(case, labelled=False)
    listed = read_falls(beside)
    names = {path.name, path.stem}
    if strange := sorted(set(listed) - names):
        raise SourceError(f"{beside}: names '{strange[0]}', expected '{path.name}'")
    return replace(case, falls=checked(case, [fall for falls in listed.values() for fall in falls], beside))
