"""A client waits for its router: interruptibly, audibly, and who only looks not for ever."""

from __future__ import annotations

import logging
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from bridge_toys import PATIENCE_S, free_ports

from bridge.errors import TransportError
from bridge.transport import waiting
from bridge.transport.waiting import open_waiting


def test_what_opens_is_returned_and_what_fails_is_raised() -> None:
    assert open_waiting(lambda: "session", "drive", ["tcp/r:1"], None) == "session"

    def refuse() -> None:
        raise KeyError("refused")

    with pytest.raises(KeyError, match="refused"):
        open_waiting(refuse, "drive", ["tcp/r:1"], None)


def test_a_wait_is_told_and_ends(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(waiting, "TELL_S", 0.0)
    never = threading.Event()
    with pytest.raises(TransportError, match=r"recorder: no router answers at tcp/r:1 .* within 0.1 s"):
        open_waiting(never.wait, "recorder", ["tcp/r:1"], 0.1)
    never.set()
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "recorder waits for a router at tcp/r:1" in caplog.text


@pytest.mark.processes
@pytest.mark.parametrize(
    "words",
    [["-m", "bridge.cli", "record", "--out", "walk.mcap"], ["-m", "simulation.drive.node"]],
    ids=["record", "drive"],
)
def test_a_process_without_its_router_can_be_stopped(words: list[str], tmp_path: Path) -> None:
    router = f"bridge.connect=['tcp/127.0.0.1:{free_ports(1)[0]}']"
    process = subprocess.Popen(
        [sys.executable, *words, "--set", "bridge.mode=client", "--set", router],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    said = ""
    while "waits for a router" not in said:
        line = process.stderr.readline()
        assert line, said
        said += line
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode in (0, 143, -signal.SIGTERM)
    assert out == ""
    assert not list(tmp_path.glob("*.mcap"))
