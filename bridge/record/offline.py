"""Replaying a recording through one or more nodes as fast as they go, with the same result every time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from bridge.clock import nanoseconds, seconds
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.lockstep import LockStep
from bridge.record.reader import Recording
from bridge.record.roles import inputs, outputs
from bridge.topics import Topic
from bridge.transport.interface import Sample

IDLE_NS: Final = nanoseconds(0.05)  # the longest that a node which waits for messages waits

Keep = Callable[[Topic, Sample], None]


class Replayed(NamedTuple):
    """What a replay fed to the nodes and what they answered, messages by key."""

    fed: Mapping[str, int]
    answered: Mapping[str, int]
    simulated_s: float


def replay_offline(
    recording: Recording,
    roles: Sequence[str],
    config: SurefootConfig,
    options: Mapping[str, Mapping[str, str]],
    keep: Keep,
    on_progress: Callable[[float], None] = lambda _fraction: None,
) -> Replayed:
    """Feed the recorded inputs of `roles` to their nodes in lock-step, at the recorded times of arrival.

    The nodes start with the recording's first message and run to its last. Nothing measures
    real time, so that two replays give the same bytes.

    Args:
        recording: what to feed; the samples reach the nodes as they were, stamps and numbers included.
        roles: which nodes run; what one of them publishes for another is not fed from the recording.
        config: of the nodes; `launch.modules` names their modules.
        options: of each role.
        keep: is given every message that the nodes publish, in order.
        on_progress: is told how much of the recording was read, 0..1.

    Raises:
        SourceError: the recording cannot be read, or has nothing that `roles` read.
    """
    wanted = {topic.key for topic in inputs(roles)}
    fed: Counter[str] = Counter()
    answered: Counter[str] = Counter()
    system: LockStep | None = None
    first_ns = now_ns = last_ns = 0
    try:
        for topic, sample, _ in recording.samples():
            last_ns = sample.arrival_ns
            if system is None:
                first_ns = now_ns = last_ns
                nodes = {role: (config.launch.modules[role], options.get(role, {})) for role in roles}
                system = LockStep(config, nodes, first_ns)
                _listen(system, outputs(roles), answered, keep)
            while last_ns - now_ns > IDLE_NS:
                now_ns += IDLE_NS
                system.advance_to(now_ns)
            if topic.key in wanted:
                now_ns = last_ns
                system.deliver(topic, sample)
                fed[topic.key] += 1
                on_progress(recording.progress)
        if system is not None:
            system.advance_to(last_ns)
    finally:
        if system is not None:
            system.close()
    if not fed:
        readers, keys = " and ".join(roles), ", ".join(sorted(wanted))
        raise SourceError(f"{recording.path}: holds nothing that is fed to {readers} ({keys})")
    return Replayed(fed, answered, seconds(last_ns - first_ns))


def _listen(system: LockStep, topics: Sequence[Topic], answered: Counter[str], keep: Keep) -> None:
    door = system.hub.transport()
    for topic in topics:

        def take(sample: Sample, topic: Topic = topic) -> None:
            answered[topic.key] += 1
            keep(topic, sample)

        door.subscribe(topic, take)
