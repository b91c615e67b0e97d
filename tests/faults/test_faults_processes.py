"""A part of the fault suite on the real processes: one fault of each kind, every stream, one process killed.

The whole, with its deadlines, is `make faults`; here the machine may be busy, so the time it takes is not judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from benchmarks.faults.judge import Outcome
from benchmarks.faults.process_rows import PROCESS_ROWS
from benchmarks.faults.stream_faults import FAULTS
from benchmarks.faults.stream_rows import run_stream_row
from benchmarks.faults.system import DirectSystem, RelayedSystem

pytestmark = [pytest.mark.processes, pytest.mark.timeout(600)]
TRIES = 4  # on a machine with too little time a stop may have another reason than the one under test
BY_NAME = {fault.name: fault for fault in FAULTS}
ROWS = {row.row: row for row in PROCESS_ROWS}


@pytest.fixture(scope="module")
def relayed() -> Iterator[RelayedSystem]:
    with RelayedSystem() as system:
        system.start()
        yield system


def judged(run: Callable[[], Outcome]) -> list[str]:
    """Return what was wrong with the best of a few tries, deadlines apart."""
    problems: list[str] = []
    for _ in range(TRIES):
        problems = [problem for problem in run().problems if not problem.startswith("safe after")]
        if not problems:
            break
    return problems


@pytest.mark.parametrize(
    ("stream", "fault"),
    [
        ("wrench", "off"),
        ("odometry", "garbage"),
        ("horizon", "frozen"),
        ("keypoints", "wrong value"),
        ("command", "clock ahead"),
    ],
)
def test_a_fault_stops_the_walker_says_why_and_is_forgiven(relayed: RelayedSystem, stream: str, fault: str) -> None:
    assert judged(lambda: run_stream_row(relayed, stream, BY_NAME[fault])) == []


def test_a_killed_controller_is_started_again() -> None:
    with DirectSystem() as system:
        system.start()
        assert judged(lambda: ROWS["SIGKILL controller"].run(system)) == []
