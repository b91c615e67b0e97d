"""Running one node as a process: arguments, wire, loop, diagnostics, signals."""

from __future__ import annotations

import argparse
import gc
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import NamedTuple, Protocol

from bridge.clock import Clock, SystemClock
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SurefootError
from bridge.exit_codes import ExitCode
from bridge.loop import run_loop
from bridge.messages import NodeStatus
from bridge.outbox import Outbox
from bridge.realtime import raise_priority
from bridge.topics import DIAGNOSTICS
from bridge.transport.interface import Transport
from bridge.transport.wire_log import WireLog
from bridge.transport.zenoh import ZenohTransport


class NodeContext(NamedTuple):
    """What a node is built from."""

    config: SurefootConfig
    transport: Transport
    clock: Clock
    log: logging.Logger
    options: Mapping[str, str]  # of this role alone, `launch.options` and the command line; they win over the config
    config_path: Path | None = None  # for parts that reload while running
    overrides: tuple[str, ...] = ()


class Node(Protocol):
    """One process of the system, or one part of a lock-step run."""

    @property
    def period_s(self) -> float | None:
        """Period of the loop [s]; None if the node paces itself in `wait`."""
        ...

    def step(self, now_ns: int) -> None:
        """Do one turn of work at time `now_ns`."""
        ...

    def wait(self) -> None:
        """Return when there may be work, at the latest after 50 ms."""
        ...

    def status(self, now_ns: int) -> NodeStatus:
        """Return how the node is doing."""
        ...

    def finished(self) -> bool:
        """Return whether the node has nothing left to do, ever."""
        ...

    def close(self) -> None:
        """Release what the node holds."""
        ...


Factory = Callable[[NodeContext], Node]
Priority = Callable[[SurefootConfig], int]  # SCHED_FIFO priority that the configuration asks for, 0 for none


class _StopFlag:
    """Set by SIGINT and SIGTERM; while there is nothing to finish yet, they end the process at once."""

    def __init__(self) -> None:
        self.set = False
        self.working = False
        signal.signal(signal.SIGINT, self._raise)
        signal.signal(signal.SIGTERM, self._raise)

    def _raise(self, _number: int, _frame: object) -> None:
        self.set = True
        if not self.working:  # a client may be waiting for its router
            raise SystemExit(ExitCode.DONE)


def main(role: str, factory: Factory, arguments: Sequence[str] | None = None, priority: Priority = lambda _: 0) -> int:
    """Run `role` until it is finished or told to stop; return the exit code (2: bad input, said in one line)."""
    parsed = _parse(role, arguments)
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format=f"%(asctime)s {role} %(levelname)s %(message)s")
    try:
        stop = _StopFlag()
        given = _options(parsed.option)
        path = Path(parsed.config) if parsed.config else None
        config = load_config(path, parsed.set)
        options = {**config.launch.options_of(role), **given}
        clock = SystemClock()
        log = logging.getLogger(role)
        with ExitStack() as stack:
            wire_log = stack.enter_context(WireLog(log)) if config.bridge.keys else None
            transport = stack.enter_context(closing(ZenohTransport(config.bridge, role, clock)))
            stop.working = True
            if wire_log is not None:
                stack.callback(wire_log.watch, None)  # nobody looks at a session that is closed
                wire_log.watch(transport.session)
            context = NodeContext(config, transport, clock, log, options, path, tuple(parsed.set))
            _serve(role, factory, context, stop, parsed.after, priority(config))
    except SurefootError as error:
        print(f"surefoot {role}: {error}", file=sys.stderr)  # noqa: T201 (the one line a user reads)
        return error.exit_code
    return 0


def _serve(
    role: str, factory: Factory, context: NodeContext, stop: _StopFlag, after: Sequence[str], priority: int
) -> None:
    node = factory(context)
    try:
        await_roles(context.transport, after, context.config.launch.ready_timeout_s, lambda: stop.set)
        diagnostics = Outbox(context.transport, DIAGNOSTICS)
        context.transport.declare_alive(role)
        gc.collect()
        gc.freeze()  # what start-up allocated is not walked again by every collection
        scheduling = raise_priority(priority)
        if priority:
            context.log.log(logging.INFO if scheduling.startswith("SCHED") else logging.WARNING, scheduling)
        parent = os.getppid()
        run_loop(
            node,
            diagnostics,
            context.clock,
            lambda: stop.set or os.getppid() != parent,  # the launcher was killed: do not run on unattended
            context.log,
            scheduling,
        )
    finally:
        node.close()


def await_roles(transport: Transport, roles: Sequence[str], timeout_s: float, stop: Callable[[], bool]) -> bool:
    """Wait until all `roles` are on the wire, at most `timeout_s`; return whether they are."""
    if not roles:
        return True
    missing, complete = set(roles), threading.Event()

    def note(role: str, alive: bool) -> None:
        if alive:
            missing.discard(role)
        if not missing:
            complete.set()

    handle = transport.watch_alive(note)
    try:
        end_s = time.monotonic() + timeout_s
        while not (complete.wait(0.05) or stop() or time.monotonic() > end_s):
            pass
    finally:
        handle.close()
    return complete.is_set()


def _parse(role: str, arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=f"surefoot {role}", description=f"Run the {role} process.")
    parser.add_argument("--config", default="", help="configuration file (TOML)")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE", help="override one value")
    parser.add_argument("--option", action="append", default=[], metavar="NAME=VALUE", help="option of this role")
    parser.add_argument(
        "--after", action="append", default=[], metavar="ROLE", help="wait for this role before the first turn"
    )
    return parser.parse_args(arguments)


def _options(pairs: Sequence[str]) -> dict[str, str]:
    options: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise ConfigError(f"--option {pair}: expected NAME=VALUE")
        options[name] = value
    return options
