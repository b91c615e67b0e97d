"""The loop around a node: turns on a fixed schedule, a report of itself now and then, until told to stop."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from bridge.clock import NS, Clock, nanoseconds
from bridge.outbox import Outbox
from bridge.realtime import Collector
from bridge.timing import Schedule, Spread
from bridge.topics import DIAGNOSTICS

if TYPE_CHECKING:
    from bridge.node import Node

STATUS_PERIOD_NS: Final = nanoseconds(1.0 / DIAGNOSTICS.rate_hz)


def run_loop(
    node: Node, diagnostics: Outbox, clock: Clock, stopped: Callable[[], bool], log: logging.Logger, scheduling: str
) -> None:
    """Turn `node` until it is finished or `stopped()`.

    A node with a period turns on a schedule that keeps its phase: a late turn is late, the turns whose time has gone
    by are missed, nothing is made up for. Its status is published with what the loop knows: missed periods, how
    long the turns took, and under which scheduling. A node without a period paces itself.
    """
    if node.period_s is None:
        _run_unpaced(node, diagnostics, clock, stopped)
    else:
        _run_periodic(node, nanoseconds(node.period_s), diagnostics, clock, stopped, log, scheduling)


def _run_unpaced(node: Node, diagnostics: Outbox, clock: Clock, stopped: Callable[[], bool]) -> None:
    status_due_ns = clock.now_ns()
    while not (stopped() or node.finished()):
        now_ns = clock.now_ns()
        node.step(now_ns)
        if now_ns >= status_due_ns:
            diagnostics.send(node.status(now_ns))
            status_due_ns = now_ns + STATUS_PERIOD_NS
        node.wait()


def _run_periodic(
    node: Node,
    period_ns: int,
    diagnostics: Outbox,
    clock: Clock,
    stopped: Callable[[], bool],
    log: logging.Logger,
    scheduling: str,
) -> None:
    start_ns = clock.now_ns()
    schedule, turn_s, collector = Schedule(start_ns, period_ns), Spread(), Collector(start_ns)
    status_due_ns = start_ns
    with collector():
        while not (stopped() or node.finished()):
            now_ns = clock.now_ns()
            schedule.begin(now_ns)
            node.step(now_ns)
            turn_s.note((clock.now_ns() - now_ns) / NS)
            if now_ns >= status_due_ns:
                status = node.status(now_ns)
                own = {"missed_periods": str(schedule.missed), **turn_s.report("turn"), "scheduling": scheduling}
                diagnostics.send(replace(status, values={**status.values, **own}))
                status_due_ns = now_ns + STATUS_PERIOD_NS
            collector.pause(clock.now_ns(), schedule.due_ns)
            clock.sleep_until(schedule.due_ns)
    span_s = (clock.now_ns() - start_ns) / NS
    p50, p99, largest = (1e3 * value for value in turn_s.percentiles())
    log.info(
        "%d turns in %.1f s, %d periods missed; a turn took p50 %.2f, p99 %.2f, at most %.2f ms; scheduling: %s",
        turn_s.count, span_s, schedule.missed, p50, p99, largest, scheduling,
    )  # fmt: skip
