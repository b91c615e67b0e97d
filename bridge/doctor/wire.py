"""Whether the wire can be opened as configured, who is there, and whether their clocks agree with ours."""

from __future__ import annotations

import shlex
import socket
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from typing import Final, NamedTuple

from bridge.clock import NS, SystemClock
from bridge.codec import decode
from bridge.config.bridge import BridgeConfig, is_loopback
from bridge.doctor.clock import FUTURE_MS, mend_clock
from bridge.doctor.finding import Finding, Level, Patient
from bridge.errors import InvalidMessage, SurefootError
from bridge.launch.ports import is_free
from bridge.topics import TOPICS, Topic
from bridge.transport.interface import Sample, Transport
from bridge.transport.zenoh import ZenohTransport

WIRE: Final = "wire"
LISTEN_S: Final = 2.0  # several messages of the slowest stream, and the time to find each other
REACH_S: Final = 1.0


class Heard(NamedTuple):
    """What came over the wire."""

    alive: frozenset[str]  # roles
    ages_s: Mapping[Topic, Sequence[float]]  # arrival less stamp, by clocks that may differ [s]


def check_wire(patient: Patient) -> Iterator[Finding]:
    """Whether a session opens, whose ports are taken by whom, and who is heard."""
    bridge = patient.config.bridge
    try:
        with closing(ZenohTransport(bridge, "doctor", SystemClock())) as transport:
            heard = listen(transport, pause)
    except SurefootError as error:
        yield Finding(WIRE, Level.BROKEN, f"no session: {error}", "surefoot doctor --only config,certificates")
        return
    alive = ", ".join(sorted(heard.alive)) or "nobody, as long as nothing runs"
    yield Finding(WIRE, Level.GOOD, f"a session opens; heard: {alive}")
    config = f" --config {shlex.quote(str(patient.config_path))}" if patient.config_path else ""
    yield from judge_ports(bridge, patient.config.launch.roles, heard.alive)
    yield from judge_reach(bridge, config)
    yield from judge_streams(heard.ages_s)


def pause() -> None:
    """Wait for what comes by itself."""
    time.sleep(LISTEN_S)


def listen(transport: Transport, wait: Callable[[], None]) -> Heard:
    """Return what is heard on `transport` while `wait` lasts."""
    alive: dict[str, bool] = {}
    samples: dict[Topic, list[Sample]] = defaultdict(list)
    handles = [transport.watch_alive(alive.__setitem__)]
    handles += [transport.subscribe(topic, samples[topic].append) for topic in TOPICS]
    wait()
    for handle in handles:
        handle.close()
    ages = {topic: list(_ages(topic, came)) for topic, came in samples.items()}
    return Heard(frozenset(role for role, is_alive in alive.items() if is_alive), ages)


def _ages(topic: Topic, samples: Sequence[Sample]) -> Iterator[float]:
    for sample in samples:
        try:
            message = decode(topic, sample.payload, max(sample.sequence, 0))
        except InvalidMessage:
            continue
        yield (sample.arrival_ns - message.stamp_ns) / NS


def judge_ports(bridge: BridgeConfig, roles: Sequence[str], alive: frozenset[str]) -> Iterator[Finding]:
    """Give a finding for each of `roles` that would find its port taken."""
    for role in roles:
        endpoint = bridge.endpoints.get(role, "")
        if bridge.mode == "client" or not endpoint or is_free(endpoint):
            continue
        port = endpoint.rpartition(":")[2]
        if role in alive:
            yield Finding(WIRE, Level.NOTE, f"{role} runs already, at {endpoint}")
        else:
            yield Finding(
                WIRE,
                Level.BROKEN,
                f"{role} cannot listen on {endpoint}: the port is taken, and not by a {role} that is heard",
                f"sudo ss -lntup 'sport = :{port}' names who has it; or set bridge.endpoints.{role}",
            )


def judge_reach(bridge: BridgeConfig, config: str) -> Iterator[Finding]:
    """Give a finding for each place that is to be connected to and where nobody answers.

    Args:
        bridge: where everybody is.
        config: how a command names the configuration.
    """
    for endpoint in dict.fromkeys((*bridge.connect, *bridge.router.connect)):
        why = unreachable(endpoint)
        if why:
            mend = f"surefoot router{config}" if is_loopback(endpoint) else f"on that machine: surefoot router{config}"
            yield Finding(WIRE, Level.BROKEN, f"{endpoint}: {why}", mend)
    for role, endpoint in bridge.endpoints.items():
        why = "" if is_loopback(endpoint) else unreachable(endpoint)
        if why:
            yield Finding(WIRE, Level.WARNING, f"{role} at {endpoint}: {why}", f"start {role} there, if it should run")


def unreachable(endpoint: str) -> str:
    """Return why nobody can be connected to at `endpoint`, '' if somebody can or nobody can tell (UDP)."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if protocol not in {"tcp", "tls"}:
        return ""
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=REACH_S).close()
    except OSError as error:
        return f"nobody answers ({error.strerror or error})"
    return ""


def judge_streams(ages_s: Mapping[Topic, Sequence[float]]) -> Iterator[Finding]:
    """Give a finding for each stream that is heard: how old it is, and whether its writer's clock can be right.

    The least age of a stream is the journey less what the writer's clock is ahead; a journey takes no negative time.
    """
    for topic, ages in ages_s.items():
        if not ages:
            continue
        least_ms = 1e3 * min(ages)
        said = f"{topic.key}: {len(ages)} in {LISTEN_S:g} s"
        if least_ms < -FUTURE_MS:
            text = f"{said}, from a clock at least {-least_ms:.0f} ms ahead of ours; limit {FUTURE_MS:.0f}"
            yield Finding(WIRE, Level.BROKEN, text, f"on both machines: {mend_clock()}")
        elif min(ages) > topic.max_age_s:
            text = f"{said}, {least_ms:.0f} ms old at best; limit {1e3 * topic.max_age_s:.0f}"
            yield Finding(WIRE, Level.BROKEN, f"{text}: a slow network, or clocks apart", f"on both: {mend_clock()}")
        else:
            yield Finding(WIRE, Level.GOOD, f"{said}, {least_ms:.0f} ms old at best")
