"""The recorder as a process on a real wire: killed, interrupted, out of disk, fed by several publishers."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from bridge_recordings import keypoints
from bridge_toys import PATIENCE_S, free_ports, wait_until

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.messages import Wrench
from bridge.outbox import Outbox
from bridge.record.reader import Recording
from bridge.topics import KEYPOINTS, WRENCH, Topic
from bridge.transport.interface import Sample
from bridge.transport.zenoh import ZenohTransport

pytestmark = pytest.mark.processes

ROLES = ("perception", "anticipation", "controller", "drive")


class Publishers:
    """Perception and drive, each a session of its own, publishing from a thread until closed."""

    def __init__(self, naming: Literal["ros2dds", "rmw_zenoh"] = "ros2dds") -> None:
        self.endpoints = {
            role: f"tcp/127.0.0.1:{port}" for role, port in zip(ROLES, free_ports(len(ROLES)), strict=True)
        }
        self.config = BridgeConfig(endpoints=self.endpoints, naming=naming)
        clock = SystemClock()
        self._transports = [ZenohTransport(self.config, role, clock) for role in ("perception", "drive")]
        self._keypoints = Outbox(self._transports[0], KEYPOINTS)
        self._wrench = Outbox(self._transports[1], WRENCH)
        self._clock, self._stop = clock, threading.Event()
        self.running = threading.Event()
        self.running.set()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    @property
    def sent(self) -> dict[Topic, int]:
        return {KEYPOINTS: self._keypoints.sent, WRENCH: self._wrench.sent}

    def _publish(self) -> None:
        while not self._stop.wait(0.01):
            if self.running.is_set():
                now_ns = self._clock.now_ns()
                self._keypoints.send(keypoints(now_ns))
                self._wrench.send(Wrench(stamp_ns=now_ns, force=np.zeros(3), torque=np.zeros(3)))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        for transport in self._transports:
            transport.close()

    def settings(self) -> list[str]:
        pairs = [f"bridge.endpoints.{role}={endpoint}" for role, endpoint in self.endpoints.items()]
        return [word for pair in [*pairs, f"bridge.naming={self.config.naming}"] for word in ("--set", pair)]


@pytest.fixture
def publishers(request: pytest.FixtureRequest) -> Iterator[Publishers]:
    with closing(Publishers(getattr(request, "param", "ros2dds"))) as made:
        yield made


class Surefoot:
    """`surefoot record` as a process."""

    def __init__(self, publishers: Publishers, out: Path, *arguments: str, limit_bytes: int = -1) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bridge.cli", "record", "--out", str(out), *publishers.settings(), *arguments],
            stderr=subprocess.PIPE,
            text=True,
            cwd=out.parent,
        )
        if limit_bytes >= 0:
            resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    def end(self) -> tuple[int, str]:
        _, said = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, said

    def __enter__(self) -> Surefoot:
        return self

    def __exit__(self, *error: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


def numbers(path: Path) -> dict[Topic, list[int]]:
    """Return the numbers of the recorded messages, as far as the file can be read now."""
    found: dict[Topic, list[int]] = {KEYPOINTS: [], WRENCH: []}
    if path.exists() and path.stat().st_size > 8:
        for recorded in Recording(path).samples((KEYPOINTS, WRENCH)):
            found[recorded.topic].append(recorded.sample.sequence)
    return found


def holds(path: Path, count: int) -> bool:
    return all(len(found) >= count for found in numbers(path).values())


def unbroken(found: list[int]) -> bool:
    return found == list(range(found[0], found[0] + len(found)))


def test_killed_while_recording_what_was_there_stays(publishers: Publishers, tmp_path: Path) -> None:
    out = tmp_path / "killed.mcap"
    with Surefoot(publishers, out) as surefoot:
        wait_until(lambda: holds(out, 100), "a hundred of each are on the disk")
        before = numbers(out)
        surefoot.process.kill()
        sent = publishers.sent
        surefoot.end()
    after = numbers(out)
    for topic, found in after.items():
        assert unbroken(found)
        assert sent[topic] - found[-1] <= 100, "at most the last second is missing, of a hundred a second"
        assert found[: len(before[topic])] == before[topic]


def test_killed_when_all_is_quiet_nothing_is_missing(publishers: Publishers, tmp_path: Path) -> None:
    """Nothing waits for the end of the recording: what was sent reaches the disk while the recorder runs."""
    out = tmp_path / "quiet.mcap"
    with Surefoot(publishers, out) as surefoot:
        wait_until(lambda: holds(out, 20), "the recorder listens")
        publishers.running.clear()
        wait_until(
            lambda: all(found[-1] == publishers.sent[topic] - 1 for topic, found in numbers(out).items()),
            "the last message is on the disk",
        )
        surefoot.process.kill()
        surefoot.end()
    recording = Recording(out)
    assert all(unbroken(found) for found in numbers(out).values())
    assert len(list(recording.samples())) > 40
    assert "cut off" in recording.damage


@pytest.mark.parametrize("publishers", ["ros2dds", "rmw_zenoh"], indirect=True)
def test_interrupted_it_finishes_the_file(publishers: Publishers, tmp_path: Path) -> None:
    out = tmp_path / "walk"
    with Surefoot(publishers, out) as surefoot:
        wait_until(lambda: holds(out / "walk_0.mcap", 20), "some messages are on the disk")
        surefoot.process.send_signal(signal.SIGINT)
        code, said = surefoot.end()
    assert code == 0
    assert "messages in" in said.splitlines()[-1]
    recording = Recording(out)
    assert len(list(recording.samples())) >= 40
    assert recording.damage == ""
    assert (out / "metadata.yaml").is_file()


def test_a_full_disk_ends_the_recorder_and_nothing_else(publishers: Publishers, tmp_path: Path) -> None:
    out = tmp_path / "full.mcap"
    arrived: list[Sample] = []
    with closing(ZenohTransport(publishers.config, "reader", SystemClock())) as reader:
        reader.subscribe(WRENCH, arrived.append)
        with Surefoot(publishers, out, limit_bytes=12_000) as surefoot:
            code, said = surefoot.end()
        ended = publishers.sent[WRENCH]
        wait_until(lambda: arrived and arrived[-1].sequence > ended, "the wire goes on")
        assert unbroken([sample.sequence for sample in list(arrived)])
    assert code == 2
    assert "full.mcap: cannot be written any more: File too large" in said.splitlines()[-1]
    assert "Traceback" not in said
    assert out.stat().st_size <= 12_000
    assert all(unbroken(found) for found in numbers(out).values() if found)
    assert "cut off" in _damage(out)


def _damage(path: Path) -> str:
    recording = Recording(path)
    for _ in recording.samples():
        pass
    return recording.damage
