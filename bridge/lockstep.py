"""The whole system in one process and in simulated time: the very nodes that run live, stepped in turn.

Used where results must not depend on the machine: offline assessment, replays,
simulated campaigns. The nodes talk through the in-memory transport; a manual clock
tells them the time.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Final

from bridge.clock import ManualClock, nanoseconds
from bridge.config.surefoot import SurefootConfig
from bridge.node import Factory, Node, NodeContext
from bridge.plugin import load_module
from bridge.topics import Topic
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub

NO_LIMIT_S: Final = 1e10  # what solvers take for no limit


def load_factory(module: str) -> Factory:
    """Return the `create` function of a node's module or file named by string."""
    factory: Factory = load_module(module).create
    return factory


def without_real_time(config: SurefootConfig) -> SurefootConfig:
    """Return `config` without limits in real time: they would make the result depend on the machine's load."""
    return config.model_copy(update={"mpc": config.mpc.model_copy(update={"time_limit_s": NO_LIMIT_S})})


class LockStep:
    """Nodes on one in-memory wire.

    Args:
        config: configuration every node gets, without its limits in real time.
        nodes: role -> its module (or a factory) and options, in the order in which they are stepped within one instant.
        start_ns: simulated time at which everything starts [ns].
    """

    def __init__(
        self, config: SurefootConfig, nodes: Mapping[str, tuple[str | Factory, Mapping[str, str]]], start_ns: int
    ) -> None:
        config = without_real_time(config)
        self.clock = ManualClock(start_ns)
        self.hub = MemoryHub(self.clock)
        self._now_ns = start_ns
        self._event_driven: list[Node] = []
        self._periodic: list[tuple[Node, int]] = []
        self._due_ns: list[int] = []
        for role, (module, options) in nodes.items():
            context = NodeContext(
                without_real_time(config),
                self.hub.transport(),
                self.clock,
                logging.getLogger(f"lockstep.{role}"),
                {**config.launch.options_of(role), **options},
            )
            node = (load_factory(module) if isinstance(module, str) else module)(context)
            if node.period_s is None:
                self._event_driven.append(node)
            else:
                self._periodic.append((node, nanoseconds(node.period_s)))
                self._due_ns.append(start_ns)

    def advance_to(self, when_ns: int) -> None:
        """Run the periodic nodes up to `when_ns` (exclusive), then the event-driven ones at `when_ns`."""
        self._run_periodic_before(when_ns)
        self._now_ns = when_ns
        self.clock.sleep_until(when_ns)
        for node in self._event_driven:
            node.step(when_ns)

    def deliver(self, topic: Topic, sample: Sample) -> None:
        """Run the periodic nodes up to the arrival of `sample`, put it on the wire, then run the event-driven nodes."""
        self._run_periodic_before(sample.arrival_ns)
        self._now_ns = sample.arrival_ns
        self.clock.sleep_until(sample.arrival_ns)
        self.hub.deliver(topic, sample)
        for node in self._event_driven:
            node.step(sample.arrival_ns)

    def settle(self) -> None:
        """Let every periodic node take its next turn, so that what just happened reaches its output.

        A node that already had a turn later than now is left alone.
        """
        now_ns = self._now_ns
        for index, (node, period_ns) in enumerate(self._periodic):
            due_ns = self._due_ns[index]
            if due_ns - now_ns <= period_ns:
                self.clock.sleep_until(due_ns)
                node.step(due_ns)
                self._due_ns[index] = due_ns + period_ns

    def close(self) -> None:
        """Close every node."""
        for node in self._event_driven:
            node.close()
        for node, _ in self._periodic:
            node.close()

    def _run_periodic_before(self, when_ns: int) -> None:
        while self._due_ns:
            index = min(range(len(self._due_ns)), key=self._due_ns.__getitem__)
            due_ns = self._due_ns[index]
            if due_ns >= when_ns:
                return
            node, period_ns = self._periodic[index]
            self.clock.sleep_until(due_ns)
            node.step(due_ns)
            self._due_ns[index] = due_ns + period_ns
