"""What keeps a loop on time in an interpreter: garbage collected between turns, priority where it is allowed."""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bridge.clock import NS

COLLECT_NS: Final = NS  # garbage is looked for once a second
ROOM_NS: Final = 3_000_000  # in a pause of at least this length: a collection of what a loop leaves takes under one
OVERDUE: Final = 10  # after so many seconds without such a pause, in whatever pause there is


class Collector:
    """Collects garbage where it costs no turn.

    The automatic collection, which strikes in the middle of whatever allocates, is off. A loop that never pauses
    still collects every ten seconds, so that nothing can pile up.
    """

    def __init__(self, now_ns: int) -> None:
        self._last_ns = now_ns

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        """Take over from the automatic collection for the life of the context."""
        gc.disable()
        try:
            yield
        finally:
            gc.enable()

    def pause(self, now_ns: int, until_ns: int) -> None:
        """Use the pause from `now_ns` to `until_ns`, if it is time to collect and the pause is long enough."""
        waited_ns = now_ns - self._last_ns
        if waited_ns >= COLLECT_NS and (until_ns - now_ns >= ROOM_NS or waited_ns >= OVERDUE * COLLECT_NS):
            self._last_ns = now_ns
            gc.collect()


def raise_priority(priority: int) -> str:
    """Run every thread of this process under SCHED_FIFO at `priority`; 0 leaves them alone.

    The wire's threads come along: one that holds the interpreter's lock while others of ordinary priority have the
    core would keep the loop waiting.

    Returns:
        In words what the process runs under, and why where it is not what was asked for.
    """
    if priority == 0:
        return "ordinary"
    asked = f"SCHED_FIFO {priority}"
    if not hasattr(os, "sched_setscheduler"):
        return f"ordinary: {asked} is not known on this system"
    try:
        for thread in _threads():
            # a process forked from this one starts as an ordinary one
            os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        return (
            f"ordinary: {asked} is not permitted (needs CAP_SYS_NICE, or an rtprio limit of at least {priority} "
            "in /etc/security/limits.conf)"
        )
    except OSError as error:
        return f"ordinary: {asked} refused: {error.strerror}"
    return asked


def _threads() -> list[int]:
    tasks = Path("/proc/self/task")
    return [int(task.name) for task in tasks.iterdir()] if tasks.is_dir() else [0]
