"""The tuning page as a process: its address, who gets it, where its parts come from, how it ends."""

from __future__ import annotations

import http.client
import re
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from controller_tuning_page_browser import WAIT_S, Served

from bridge.cli import main
from bridge.config.surefoot import SurefootConfig
from bridge.errors import MissingExtraError, SurefootError
from controller.tuning.page import serve
from controller.tuning.page.bench import Bench

pytest.importorskip("nicegui", reason="nicegui is not installed (pip install '.[tune]')")


def wait(seen: Callable[[], Any]) -> Any:
    end = time.monotonic() + WAIT_S
    while not (found := seen()):
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)
    return found


def get(served: Served, path: str, **headers: str) -> http.client.HTTPResponse:
    address = urlsplit(served.address(wait))
    connection = http.client.HTTPConnection("127.0.0.1", address.port, timeout=WAIT_S)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    answer.text = answer.read().decode(errors="replace")  # type: ignore[attr-defined]
    connection.close()
    return answer


@pytest.mark.processes
def test_the_printed_address_opens_the_page_all_of_it_comes_from_here_and_ctrl_c_ends_it(tmp_path: Path) -> None:
    served = Served(tmp_path)
    try:
        address = urlsplit(served.address(wait))
        assert address.hostname == "127.0.0.1"
        assert get(served, "/").status == 403
        first = get(served, f"/?{address.query}")
        assert (first.status, first.getheader("Location")) == (303, "/")
        cookie = str(first.getheader("Set-Cookie")).split(";")[0]
        page = get(served, "/", Cookie=cookie)
        assert page.status == 200
        text = page.text
        foreign = re.findall(r"""(?:src|href|import|url|from)\s*[=(]?\s*["'(](?:https?:)?//[^"')]+""", text)
        assert foreign == []
        scripts = re.findall(r'src="(/[^"]+\.js)"', text)
        assert scripts
        for path in scripts:
            assert get(served, path).status == 403, "not even a part of the page without the key"
            assert get(served, path, Cookie=cookie).status == 200
        assert get(served, "/", Cookie=cookie, Host="evil.example").status == 403
        assert get(served, "/nowhere", Cookie=cookie).status == 404
    finally:
        ended = served.end()
    assert ended == 0
    assert "Traceback" not in served.said.read_text()


def test_it_listens_on_this_machine_alone() -> None:
    with serve.listen(0) as listening:
        assert listening.getsockname()[0] == "127.0.0.1"


def test_a_port_in_use_is_said_with_its_number_before_a_recording_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(
            SurefootError, match=rf"--port {port}: cannot be opened on 127.0.0.1: Address already in use"
        ):
            serve.require_port(port)
        assert main(["tune", "nothing.npz", "--serve", "--port", str(port)]) == 2
        assert f"--port {port}: cannot be opened" in capsys.readouterr().err


def test_without_recordings_or_library_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SurefootError, match="no recording to show"):
        serve.serve(Bench([], SurefootConfig()), 0)
    monkeypatch.setattr(serve, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"surefoot\[tune\]"):
        serve.serve(Bench([], SurefootConfig()), 0)
