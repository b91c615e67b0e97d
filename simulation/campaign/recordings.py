"""Trials kept as recordings, each with a list of its falls beside it: what `surefoot tune` replays."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np

from bridge.lockstep import LockStep
from bridge.record.layout import SUFFIX
from bridge.record.writer import BagWriter
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from simulation.campaign.trace import Trace
from simulation.scenarios.arrest import ALLOWED_DROP_M

FOLDER: Final = "recordings"  # in the campaign's folder
KEPT: Final = (KEYPOINTS, FALL_HORIZON, WRENCH, ODOMETRY, SUPPORT_COMMAND)


class TrialRecording:
    """Records a trial while it runs; what is left of one that fails is removed.

    The list of falls is in place before the recording is: whoever finds a recording knows what happens in it.
    """

    def __init__(self, file: Path, stack: LockStep, namespace: str) -> None:
        """Record what the nodes of `stack` say into `file` (`.mcap`), which is replaced when it is whole."""
        self._file = file
        file.parent.mkdir(parents=True, exist_ok=True)
        self._partial = file.with_name(f".{file.name.removesuffix(SUFFIX)}")  # a folder of its own
        self._writer = BagWriter(self._partial, namespace, KEPT, overwrite=True)
        door = stack.hub.transport()
        for topic in KEPT:
            door.subscribe(topic, self._taking(topic))

    def __enter__(self) -> TrialRecording:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._writer.discard()

    def finish(self, falls: str) -> None:
        """Put recording and list of falls in their places."""
        self._writer.finish()
        listed = self._file.with_name(self._file.name.removesuffix(SUFFIX) + ".falls.csv")
        partial = self._partial / listed.name
        partial.write_text(falls, encoding="utf-8")
        partial.replace(listed)
        self._writer.file.replace(self._file)
        shutil.rmtree(self._partial)

    def _taking(self, topic: Topic) -> Any:
        return lambda sample: self._writer.write(topic, sample)


def falls_csv(recording: str, trace: Trace, descent_s: float, floor_m: float) -> str:
    """Return the list of falls of a trial: one from its descent on, or none.

    Args:
        recording: name of the recording.
        trace: what was noted.
        descent_s: when the pelvis began to come down [s]; NaN where it did not.
        floor_m: height of the pelvis that counts as standing [m].

    Too late is a pelvis further down than a harness allows, or somebody on the floor.
    """
    head = "recording,onset_s,impact_s,over_s\n"
    late = (trace.pelvis_m < floor_m - ALLOWED_DROP_M) | (trace.touched > 0.0)
    late &= trace.time_s > descent_s  # nothing is later than NaN
    if not late.any():
        return f"{head}{recording},,,\n"
    return f"{head}{recording},{descent_s:.3f},{trace.time_s[int(np.argmax(late))]:.3f},\n"
