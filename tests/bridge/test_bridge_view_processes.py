"""The view beside a running system, as a process: killed, interrupted, served, out of disk."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from bridge_recordings import write
from bridge_toys import PATIENCE_S, Stage, Up, all_alive, free_ports, wait_until
from bridge_view_files import Rrd, foreseen

from bridge.clock import ManualClock, SystemClock
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from bridge.topics import KEYPOINTS, SUPPORT_COMMAND, Topic
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub, MemoryTransport
from bridge.transport.zenoh import ZenohTransport
from bridge.view.extra import load_rerun
from bridge.view.rrd import RrdFile
from bridge.view.studio import Studio, Subject
from bridge.view.viewer import Viewer
from perception.skeleton import LINKS

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'surefoot[view]'")


class Deaf(MemoryTransport):
    """A wire on which nothing may be said."""

    def publisher(self, topic: Topic) -> object:  # type: ignore[override]
        raise AssertionError(f"the view publishes {topic.key}")

    def declare_alive(self, role: str) -> object:  # type: ignore[override]
        raise AssertionError(f"the view says that it is {role}")


def test_it_only_listens(tmp_path: Path) -> None:
    from bridge_view_files import PLANE

    clock = ManualClock()
    hub = MemoryHub(clock)
    turns = iter(range(3))
    events = foreseen(0.3)

    def ended() -> bool:
        turn = next(turns, None)
        if turn == 1:
            hub.mark("controller", +1)
            for event in events:
                hub.deliver(event.topic, event.sample)
        return turn is None

    with RrdFile(tmp_path / "live.rrd") as file:
        studio = Studio(load_rerun(), Subject(SurefootConfig(), PLANE, LINKS, None), [], file)
        assert studio.show_live(Deaf(hub), clock, ended) == 0
        assert not any(hub.subscribers.values())
        studio.finish()
    rrd = Rrd(tmp_path / "live.rrd")
    assert len(rrd.drawn("/series/stiffening", "scalars")) == 30
    assert len(rrd.drawn("/image/person/links", "strips")) == 9
    assert "controller is on the wire" in rrd.events()


@contextmanager
def view(*arguments: str, cwd: Path, limit_bytes: int = -1) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "bridge.cli", "view", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    if limit_bytes >= 0:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.processes
def test_killed_beside_a_running_system_nothing_changes(tmp_path: Path) -> None:
    (tmp_path / "stage").mkdir()
    stage = Stage(tmp_path / "stage")
    heard: dict[Topic, list[Sample]] = {KEYPOINTS: [], SUPPORT_COMMAND: []}
    config = str(stage.config)
    with Up(stage) as up:
        up.wait_for(all_alive())
        with closing(ZenohTransport(load_config(stage.config).bridge, "reader", SystemClock())) as reader:
            for topic, samples in heard.items():
                reader.subscribe(topic, samples.append)
            with (
                view("--out", "killed.rrd", "--config", config, cwd=tmp_path) as killed,
                view("--out", "ended.rrd", "--config", config, cwd=tmp_path) as ended,
            ):
                wait_until(lambda: _drawn(tmp_path, ".killed*.rrd"), "one draws")
                wait_until(lambda: _drawn(tmp_path, ".ended*.rrd"), "and the other")
                killed.send_signal(signal.SIGKILL)
                killed.wait(PATIENCE_S)
                before = {topic: len(samples) for topic, samples in heard.items()}
                wait_until(lambda: all(len(heard[topic]) > before[topic] + 50 for topic in heard), "all goes on")
                ended.send_signal(signal.SIGINT)
                _, said = ended.communicate(timeout=PATIENCE_S)
                assert ended.returncode == 0, said
        record = up.wait_for(all_alive())
    for samples in heard.values():
        numbers = [sample.sequence for sample in samples]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        assert len({sample.source for sample in samples}) == 1
    assert all(role["restarts"] == 0 for role in record["roles"].values()), record
    assert not (tmp_path / "killed.rrd").exists()
    rrd = Rrd(tmp_path / "ended.rrd")
    assert len(rrd.drawn("/image/person/links", "strips")) > 5
    assert rrd.drawn("/state/process/controller", "state")


@pytest.mark.processes
def test_served_on_loopback_until_it_is_told_to_end(tmp_path: Path) -> None:
    recording = write(tmp_path / "walk.mcap", foreseen(0.3))
    port = next(port for port in free_ports(20) if _is_free(port + 1))
    with view(str(recording), "--serve", "--port", str(port), cwd=tmp_path) as process:
        wait_until(lambda: not _is_free(port) and not _is_free(port + 1), "the page is there")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE_S) as page:
            assert b"rerun" in page.read().lower()
        assert _listeners(port) | _listeners(port + 1) == {"0100007F"}  # 127.0.0.1
        (server,) = _children(process.pid)
        assert os.getpgid(server) == server != os.getpgid(process.pid)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, said
    assert f"open http://127.0.0.1:{port}/" in said
    assert _is_free(port)
    assert _is_free(port + 1)
    with pytest.raises(ProcessLookupError):
        os.kill(server, 0)


@pytest.mark.processes
def test_on_a_full_disk_there_is_no_file(tmp_path: Path) -> None:
    recording = write(tmp_path / "walk.mcap", foreseen(1.0))
    with view(str(recording), "--out", "full.rrd", cwd=tmp_path, limit_bytes=200_000) as process:
        _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert said.splitlines() == ["surefoot: full.rrd: could not be written whole; is the disk full?"]
    assert [path.name for path in tmp_path.iterdir()] == ["walk.mcap"]


@pytest.mark.processes
def test_a_viewer_that_dies_is_no_quiet_end_and_keeps_its_statistics(tmp_path: Path) -> None:
    """Rerun's own program says what it makes of the environment it is given."""
    program = tmp_path / "viewer"
    settings = f"{load_rerun().viewer} analytics config | tr -d '\\n'"
    program.write_text(f'#!/bin/sh\necho "Error: $({settings})"\nexit 3\n')
    program.chmod(0o700)
    with pytest.raises(SurefootError, match="ended at once") as error:
        Viewer(program, free_ports(1)[0], [])
    assert '"analytics_enabled": false' in str(error.value)
    assert "--out FILE.rrd" in str(error.value)


def _drawn(folder: Path, pattern: str) -> bool:
    """Whether samples have reached the unfinished file: the layout alone is smaller."""
    return any(b"/image/person/links" in path.read_bytes() for path in folder.glob(pattern))


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def _listeners(port: int) -> set[str]:
    """Return the addresses on which somebody listens on `port`, as /proc/net/tcp writes them."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    rows += [line.split() for line in Path("/proc/net/tcp6").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
