"""What a soak looks at: counts, ages, memory, watchdogs; and what it makes of them. Pure but for `resident_kb`."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from bridge.clock import NS
from bridge.topics import Topic
from bridge.transport.interface import Sample

_STAMP: Final = struct.Struct("<iI")
WINDOWS: Final = 12
GROWTH_LIMIT_KB: Final = 2_048
LATENCY_GROWTH: Final = 1.5  # of the 99th percentile, last third beside first
LATENCY_FLOOR_MS: Final = 1.0  # less than this is the machine


class Counter:
    """Counts what arrives of one topic, per publisher, and how old it is; called by the wire's own thread."""

    def __init__(self, topic: Topic, begin_ns: int, end_ns: int) -> None:
        self.topic = topic
        self._begin_ns, self._window_ns = begin_ns, max((end_ns - begin_ns) // WINDOWS, 1)
        self._first: dict[bytes, int] = {}
        self._newest: dict[bytes, int] = {}
        self.heard = 0
        self.disordered = 0
        self._ages_ns: list[list[int]] = [[] for _ in range(WINDOWS)]

    def note(self, sample: Sample) -> None:
        """Take in one sample."""
        window = (sample.arrival_ns - self._begin_ns) // self._window_ns
        if not 0 <= window < WINDOWS:
            return
        source, number = sample.source, sample.sequence
        if source not in self._first:
            self._first[source] = number
        elif number <= self._newest[source]:
            self.disordered += 1
        self._newest[source] = max(number, self._newest.get(source, number))
        self.heard += 1
        ages = self._ages_ns[window]
        if self.heard % 8 == 0 and len(ages) < 20_000:
            sec, nanosec = _STAMP.unpack_from(sample.payload, 4)
            ages.append(sample.arrival_ns - sec * NS - nanosec)

    def result(self) -> dict[str, Any]:
        """Return counts in and out and the age on arrival over time."""
        sent = sum(self._newest[source] - first + 1 for source, first in self._first.items())
        p50 = [round(float(np.percentile(ages, 50)) / 1e6, 3) for ages in self._ages_ns if ages]
        p99 = [round(float(np.percentile(ages, 99)) / 1e6, 3) for ages in self._ages_ns if ages]
        return {
            "delivery": self.topic.quality.delivery,
            "publishers": len(self._first),
            "sent": sent,
            "heard": self.heard,
            "lost": sent - self.heard,
            "disordered": self.disordered,
            "age_p50_ms": p50,
            "age_p99_ms": p99,
        }


def judge(
    topics: Mapping[str, Mapping[str, Any]], memory_kb: Mapping[str, Sequence[float]], watchdogs: Sequence[str]
) -> list[str]:
    """Return what must not be: a lost watchdog, growth, a lost sample where none may be."""
    problems = [f"watchdog: {text}" for text in watchdogs]
    for key, topic in topics.items():
        if topic["disordered"]:
            problems.append(f"{key}: {topic['disordered']} out of order")
        if topic["delivery"] == "every" and topic["lost"]:
            problems.append(f"{key}: {topic['lost']} of {topic['sent']} lost, and none may be")
        early, late = _thirds(topic["age_p99_ms"])
        if late > max(LATENCY_GROWTH * early, early + LATENCY_FLOOR_MS):
            problems.append(f"{key}: age on arrival grew from {early:.2f} to {late:.2f} ms (p99)")
    for role, series in memory_kb.items():
        grown = growth_kb(series)
        if grown > GROWTH_LIMIT_KB:
            problems.append(f"{role}: memory grew by {grown:.0f} kB, limit {GROWTH_LIMIT_KB}")
    return problems


def growth_kb(series: Sequence[float]) -> float:
    """Return what a straight line through the last two thirds says memory grew by in that time [kB]."""
    late = np.array(series[len(series) // 3 :], dtype=float)
    if len(late) < 3:
        return 0.0
    slope = float(np.polyfit(np.arange(len(late)), late, 1)[0])
    return slope * (len(late) - 1)


def _thirds(values: Sequence[float]) -> tuple[float, float]:
    third = max(len(values) // 3, 1)
    return (float(np.median(values[:third])), float(np.median(values[-third:]))) if values else (0.0, 0.0)


def resident_kb(pid: int) -> float:
    """Return the resident set of a process [kB]; NaN if it is gone."""
    try:
        return float(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4.0
    except (OSError, IndexError):
        return float("nan")
