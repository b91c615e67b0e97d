"""Cases from recordings: the horizons, wrenches and odometry that were on the wire, when they arrived."""

from __future__ import annotations

from collections.abc import Callable
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
from controller.tuning.cases import Case, Felt, HorizonColumns, stream
from controller.tuning.falls import checked, read_falls
from controller.tuning.judging import Judge

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
    stuck_s = config.inputs.stuck_after_s
    seen, wrench, odometry = _Horizons(stuck_s), _Felt(WRENCH, stuck_s, _pull_n), _Felt(ODOMETRY, stuck_s, _descent_m_s)
    takers = {FALL_HORIZON.key: seen.take, WRENCH.key: wrench.take, ODOMETRY.key: odometry.take}
    if job.recompute:
        del takers[FALL_HORIZON.key]
    keypoints, first_ns, last_ns = 0, 0, 0
    for recorded in recording.samples():
        first_ns, last_ns = first_ns or recorded.log_time_ns, recorded.log_time_ns
        keypoints += recorded.topic.key == KEYPOINTS.key
        if recorded.topic.key in takers:
            takers[recorded.topic.key](recorded.sample)
    if last_ns - first_ns > LONGEST_S * NS:
        raise SourceError(f"{job.path}: lasts {(last_ns - first_ns) / NS / 3600:.0f} h, limit {LONGEST_S / 3600:.0f}")
    if not seen.count:
        if not keypoints:
            raise SourceError(f"{job.path}: holds neither horizons nor keypoints")
        replay_offline(recording, ["anticipation"], config, {}, seen.keep)
    period_ns = nanoseconds(1.0 / config.controller.rate_hz)
    case = Case(
        job.name,
        job.name,
        first_ns,
        period_ns,
        (last_ns - first_ns) // period_ns + 1,
        seen.columns.horizons(),
        wrench.felt(),
        odometry.felt(),
    )
    return _with_falls(case, job.path)


class _Horizons:
    """Takes horizons as they come, recorded or computed."""

    def __init__(self, stuck_after_s: float) -> None:
        self.columns = HorizonColumns(FALL_HORIZON.key)
        self.count = 0
        self._judge = Judge(FALL_HORIZON, stuck_after_s)

    def take(self, sample: Any) -> None:
        if (one := self._judge.judge(sample)) is not None:
            self.columns.add(cast(FallHorizon, one.message), one.arrival_ns, one.fault)
            self.count += 1

    def keep(self, topic: Topic, sample: Any) -> None:
        if topic.key == FALL_HORIZON.key:
            self.take(sample)


class _Felt:
    """Takes one number of each wrench or odometry."""

    def __init__(self, topic: Topic, stuck_after_s: float, value: Callable[[Any], float]) -> None:
        self._topic, self._judge, self._value = topic, Judge(topic, stuck_after_s), value
        self._rows: list[tuple[int, int, str, float]] = []

    def take(self, sample: Any) -> None:
        if (one := self._judge.judge(sample)) is not None:
            self._rows.append((one.arrival_ns, one.message.stamp_ns, one.fault, self._value(one.message)))

    def felt(self) -> Felt | None:
        """Return what was felt; None for nothing."""
        if not self._rows:
            return None
        arrival_ns, stamp_ns, faults, value = zip(*self._rows, strict=True)
        return Felt(stream(self._topic.key, arrival_ns, stamp_ns, faults), np.array(value))


def _pull_n(wrench: Wrench) -> float:
    return -float(wrench.force[2])


def _descent_m_s(odometry: Odometry) -> float:
    return -float(odometry.velocity[2])


def _with_falls(case: Case, path: Path) -> Case:
    beside = path.with_name(path.name.removesuffix(SUFFIX) + SIDECAR)
    if not beside.exists():
        return replace(case, labelled=False)
    listed = read_falls(beside)
    names = {path.name, path.stem}
    if strange := sorted(set(listed) - names):
        raise SourceError(f"{beside}: names '{strange[0]}', expected '{path.name}'")
    return replace(case, falls=checked(case, [fall for falls in listed.values() for fall in falls], beside))
