"""The same promises from the wire inside a process and from the wire between processes."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from typing import Literal, TypeAlias

import pytest

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.errors import TransportError
from bridge.inbox import Inbox
from bridge.messages import Wrench
from bridge.topics import WRENCH
from bridge.transport.interface import Sample, Transport
from bridge.transport.memory import MemoryHub
from bridge.transport.zenoh import ZenohTransport

Naming: TypeAlias = Literal["ros2dds", "rmw_zenoh"]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def bridge_config(naming: Naming = "ros2dds") -> BridgeConfig:
    ports = {role: f"tcp/127.0.0.1:{free_port()}" for role in ("perception", "anticipation", "controller", "drive")}
    return BridgeConfig(endpoints=ports, naming=naming)


def until(condition: Callable[[], bool], timeout_s: float = 15.0) -> bool:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return condition()


@pytest.fixture(params=["memory", "ros2dds", "rmw_zenoh"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[Transport, Transport]]:
    clock = SystemClock()
    if request.param == "memory":
        hub = MemoryHub(clock)
        one, two = hub.transport(), hub.transport()
    else:
        config = bridge_config(request.param)
        one, two = ZenohTransport(config, "drive", clock), ZenohTransport(config, "controller", clock)
    yield one, two
    one.close()
    two.close()


def test_samples_arrive_with_sequence_and_source(pair: tuple[Transport, Transport]) -> None:
    one, two = pair
    received: list[Sample] = []
    two.subscribe(WRENCH, received.append)
    first, second = one.publisher(WRENCH), one.publisher(WRENCH)

    def arrived() -> bool:
        first.put(b"a", 1)
        return len(received) > 2

    assert until(arrived)
    second.put(b"b", 2)
    assert until(lambda: received[-1].payload == b"b")
    numbers = [sample.sequence for sample in received if sample.payload == b"a"]
    assert numbers == sorted(set(numbers))
    assert len({sample.source for sample in received}) == 2


def test_liveliness_comes_and_goes(pair: tuple[Transport, Transport]) -> None:
    one, two = pair
    seen: dict[str, bool] = {}
    token = one.declare_alive("perception")
    two.watch_alive(seen.__setitem__)
    assert until(lambda: seen.get("perception") is True)
    token.close()
    assert until(lambda: seen["perception"] is False)


def test_a_taken_port_is_named() -> None:
    config, clock = bridge_config(), SystemClock()
    first = ZenohTransport(config, "drive", clock)
    try:
        with pytest.raises(TransportError, match=f"drive cannot listen on {config.endpoints['drive']}: the port is in"):
            ZenohTransport(config, "drive", clock)
    finally:
        first.close()


PEER = textwrap.dedent("""
    import sys, time
    from bridge.clock import SystemClock
    from bridge.config.bridge import BridgeConfig
    from bridge.messages import Wrench
    from bridge.outbox import Outbox
    from bridge.topics import WRENCH
    from bridge.transport.zenoh import ZenohTransport
    clock = SystemClock()
    wire = ZenohTransport(BridgeConfig.model_validate_json(sys.argv[1]), "drive", clock)
    wire.declare_alive("drive")
    box = Outbox(wire, WRENCH)
    while True:
        box.send(Wrench(stamp_ns=clock.now_ns(), force=[1, 2, 3], torque=[0, 0, 0]))
        time.sleep(0.01)
""")


@pytest.mark.processes
def test_a_killed_process_is_missed_and_its_successor_is_heard() -> None:
    config, clock = bridge_config(), SystemClock()
    wire = ZenohTransport(config, "controller", clock)
    alive: dict[str, bool] = {}
    wire.watch_alive(alive.__setitem__)
    inbox = Inbox[Wrench](wire, WRENCH)
    peers: list[subprocess.Popen[bytes]] = []
    try:
        for _life in range(2):
            peers.append(subprocess.Popen([sys.executable, "-c", PEER, config.model_dump_json()]))
            assert until(lambda: alive.get("drive") is True and inbox.read(clock.now_ns()).ok)
            os.kill(peers[-1].pid, signal.SIGKILL)
            assert until(lambda: alive["drive"] is False)
            assert until(lambda: "ms old, limit 60" in inbox.read(clock.now_ns()).fault)
    finally:
        for peer in peers:
            peer.kill()
            peer.wait()
        wire.close()


@pytest.mark.processes
def test_a_frozen_process_is_missed_long_before_zenohs_own_ten_seconds() -> None:
    config, clock = bridge_config(), SystemClock()
    wire = ZenohTransport(config, "controller", clock)
    alive: dict[str, bool] = {}
    wire.watch_alive(alive.__setitem__)
    peer = subprocess.Popen([sys.executable, "-c", PEER, config.model_dump_json()])
    try:
        assert until(lambda: alive.get("drive") is True)
        os.kill(peer.pid, signal.SIGSTOP)
        assert until(lambda: alive["drive"] is False, timeout_s=5.0)
        os.kill(peer.pid, signal.SIGCONT)
        assert until(lambda: alive["drive"] is True)
    finally:
        peer.kill()
        peer.wait()
        wire.close()


def test_a_slow_reader_never_blocks_the_writer() -> None:
    config, clock = bridge_config(), SystemClock()
    writer, reader = ZenohTransport(config, "drive", clock), ZenohTransport(config, "controller", clock)
    arrived, released, written = threading.Event(), threading.Event(), threading.Event()

    def stuck(_sample: Sample) -> None:
        arrived.set()
        released.wait(60.0)

    reader.subscribe(WRENCH, stuck)
    publisher, payload = writer.publisher(WRENCH), bytes(16_384)

    def write() -> None:
        for _ in range(1000):  # far more than the buffers of both ends hold
            publisher.put(payload, 0)
        written.set()

    writing = threading.Thread(target=write, daemon=True)
    try:
        while not arrived.wait(0.01):
            publisher.put(payload, 0)
        writing.start()
        assert written.wait(30.0), "a reader that is stuck in its first sample holds the writer"
    finally:
        released.set()
        if writing.ident is not None:
            writing.join(30.0)
        writer.close()
        reader.close()
