"""The logging controller: records what it was asked and answers passively."""

from __future__ import annotations

import contextlib
import json
import math
from collections import deque
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from bridge.errors import ConfigError
from bridge.messages import Odometry, SupportCommand, Wrench
from controller.interface import Decision


class LoggingController:
    """Implements `Controller` with zero velocity and the column held where it was found.

    Every call becomes a record in `records`, and one line of JSON in the log file, flushed at once
    so that it can be read while this runs. Both are bounded: `records` keeps the newest; a full
    file, and one that an earlier run left, is renamed to `FILE.1`, in place of an older one, and a new file begun.
    """

    def __init__(self, log: str = "", max_records: int = 100_000) -> None:
        """Open the log.

        Raises:
            ConfigError: the file cannot be written.
        """
        self.records: deque[dict[str, Any]] = deque(maxlen=max_records)
        self.fault = ""  # why the file is no longer written; the control loop goes on
        self._path = Path(log) if log else None
        self._file: TextIO | None = None
        self._lines = 0
        self._max_records = max_records
        self._column_height: float | None = None
        if self._path is not None:
            try:
                self._file = self._begin(self._path)
            except OSError as error:
                raise ConfigError(f"controller.log = {log}: cannot be written: {error.strerror}") from error

    def step(self, now_ns: int, odometry: Odometry, wrench: Wrench, decision: Decision) -> SupportCommand:
        """Record the call and answer: stand still, hold the column."""
        if self._column_height is None:
            self._column_height = float(odometry.position[2])
        measured = {"velocity": odometry.velocity.tolist(), "force": wrench.force.tolist()}
        self._record("step", now_ns, decision, measured)
        return SupportCommand(
            stamp_ns=now_ns,
            velocity=np.zeros(4),
            acceleration=np.zeros(4),
            column_height=self._column_height,
            stiffening=decision.stiffening,
            damping=np.zeros(4),
            stiffness=np.zeros(4),
            state=decision.state,
            solver="log",
            lifetime_s=0.06,
            reason=decision.reason,
            rests_on_ns=decision.rests_on_ns,
            fall_distance=decision.fall_distance,
            fall_probability=decision.fall_probability,
        )

    def stop(self, now_ns: int, decision: Decision) -> None:
        """Record a period in which the decision was to stop, so that nothing would have been asked of a controller."""
        self._record("stop", now_ns, decision, {})

    def reset(self) -> None:
        """Hold the column wherever it is at the next step."""
        self._column_height = None

    def close(self) -> None:
        """Close the log."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _begin(self, path: Path) -> TextIO:
        if path.is_file() and path.stat().st_size > 0:
            path.replace(path.with_name(path.name + ".1"))
        self._lines = 0
        return path.open("w", encoding="utf-8")

    def _record(self, call: str, now_ns: int, decision: Decision, measured: dict[str, list[float]]) -> None:
        record = {
            "call": call,
            "now_ns": now_ns,
            "state": decision.state.value,
            "reason": decision.reason,
            "stiffening": decision.stiffening,
            "profile": decision.profile.tolist(),
            "fall_distance": _or_none(decision.fall_distance),
            "fall_probability": _or_none(decision.fall_probability),
            "rests_on_ns": decision.rests_on_ns,
            **measured,
        }
        self.records.append(record)
        if self._file is not None and self._path is not None:
            try:
                if self._lines >= self._max_records:
                    self._file.close()
                    self._file = self._begin(self._path)
                self._file.write(json.dumps(record) + "\n")
                self._file.flush()
                self._lines += 1
            except OSError as error:
                self.fault = f"{self._path}: no longer written: {error.strerror}"
                with contextlib.suppress(OSError):
                    self._file.close()
                self._file = None


def _or_none(value: float) -> float | None:
    """JSON has no NaN."""
    return None if math.isnan(value) else value
