"""Code of one's own, named by text: found, or missed in one line that says what to do."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

import pytest

from bridge.clock import NS
from bridge.config.load import load_config
from bridge.errors import ConfigError
from bridge.lockstep import LockStep
from bridge.plugin import Plugin, load_module, load_plugin, parse_plugin

MINE = """
from dataclasses import dataclass
import neighbour

@dataclass
class Pose:
    x: float = neighbour.X

def frames(): ...
LIMIT = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "mine.py").write_text(MINE)
    (tmp_path / "lab" / "neighbour.py").write_text("X = 2.0\n")
    (tmp_path / "lab" / "broken.py").write_text("import no_such_driver\n")
    (tmp_path / "lab" / "stale.py").write_text("1 / 0\n")
    return tmp_path


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("lab.cameras:frames", Plugin("lab.cameras", "frames")),
        ("cameras:Depth2", Plugin("cameras", "Depth2")),
        ("lab/depth camera.py:frames", Plugin("lab/depth camera.py", "frames")),
        ("/abs/x.py:_f", Plugin("/abs/x.py", "_f")),
        *(
            (text, None)
            for text in ("camera:0", "clip.npz:walk", "rtsp://10.0.0.2/x", "wire", "lab.cameras", "x.py", "")
        ),
    ],
)
def test_what_is_a_plugin(text: str, expected: Plugin | None) -> None:
    assert parse_plugin(text) == expected


def test_a_file_is_loaded_once_with_its_neighbours(folder: Path) -> None:
    pose = load_plugin(Plugin("lab/mine.py", "Pose"), "source")
    assert pose().x == 2.0
    assert load_plugin(Plugin(str(folder / "lab" / "mine.py"), "Pose"), "source") is pose


def test_a_module_is_loaded() -> None:
    assert load_plugin(Plugin("bridge.clock", "nanoseconds"), "source")(1.0) == NS


@pytest.mark.parametrize(
    ("plugin", "words"),
    [
        (Plugin("lab/none.py", "frames"), "source 'x': no such file: lab/none.py"),
        (Plugin("no_such_lab.cameras", "frames"), "source 'x': no module 'no_such_lab.cameras': install it, put its"),
        (Plugin("lab/mine.py", "frame"), "source 'x': lab/mine.py: 'frame' is not there; did you mean 'frames'"),
        (Plugin("lab/mine.py", "LIMIT"), "source 'x': lab/mine.py: 'LIMIT' is no function or class"),
        (
            Plugin("lab/broken.py", "x"),
            "fails when it is imported: ModuleNotFoundError: No module named 'no_such_driver'",
        ),
        (Plugin("lab/stale.py", "x"), "lab/stale.py fails when it is imported: ZeroDivisionError: division by zero"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(folder: Path, plugin: Plugin, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        load_plugin(plugin, "source 'x'")
    assert "\n" not in str(caught.value)
    assert not any(name.startswith("surefoot_plugin.") and name.endswith(("broken", "stale")) for name in sys.modules)


NODE = """
class Node:
    period_s = 0.01
    def __init__(self, context): context.log.warning("%s", sorted(context.options.items()))
    def step(self, now_ns): ...
    def close(self): ...
def create(context): return Node(context)
"""


def test_options_of_the_configuration_reach_a_node_of_ones_own(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "lab" / "node.py").write_text(NODE)
    options = [
        "launch.options.drive.port=/dev/ttyUSB0",
        "launch.options.drive.gain=1.5",
        "launch.options.drive.dry=true",
    ]
    config = load_config(None, options)
    with caplog.at_level(logging.WARNING):
        LockStep(config, {"drive": ("lab/node.py", {"gain": "2"})}, NS).close()
    assert caplog.messages == ["[('dry', 'true'), ('gain', '2'), ('port', '/dev/ttyUSB0')]"]


def test_options_of_nobody_are_an_error() -> None:
    with pytest.raises(ConfigError, match="options names 'driver', which is no role; known: perception, "):
        load_config(None, ["launch.options.driver.port=1"])


def test_a_module_that_does_not_start_with_surefoots_errors_keeps_them(folder: Path) -> None:
    (folder / "lab" / "strict.py").write_text("from bridge.errors import SourceError\nraise SourceError('no camera')\n")
    with pytest.raises(Exception, match="^no camera$"):
        load_module("lab/strict.py")
