"""What leaves a command: JSON that is whole, pipes that close, colours where somebody looks."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bridge import cli
from bridge.cli import Command, main
from bridge.command_line import output
from bridge.command_line.output import STDOUT, plain, require_writable, result, write_json
from bridge.errors import SurefootError
from bridge.exit_codes import ExitCode
from bridge.launch.display import JsonLines, Several

SUREFOOT = [sys.executable, "-m", "bridge.cli"]


class Side(Enum):
    LEFT = "left"


class Row(NamedTuple):
    side: Side
    values: np.ndarray
    file: Path


class TestJson:
    """`--json FILE`."""

    def test_what_is_no_number_is_null_and_never_zero(self) -> None:
        row = Row(Side.LEFT, np.array([1.0, np.nan]), Path("a.npz"))
        value = {"rows": [row], "worst": float("inf"), "n": np.int64(3), 4: (True, None)}
        expected = {
            "rows": [{"side": "left", "values": [1.0, None], "file": "a.npz"}],
            "worst": None, "n": 3, "4": [True, None],
        }  # fmt: skip
        assert plain(value) == expected

    def test_to_stdout_and_to_a_file(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write_json(STDOUT, {"a": 1})
        assert json.loads(capsys.readouterr().out) == {"a": 1}
        file = tmp_path / "new" / "a.json"
        write_json(file, {"a": 2})
        assert json.loads(file.read_text()) == {"a": 2}
        assert capsys.readouterr().out == ""
        assert not Path("-").exists()

    def test_a_failure_leaves_what_was_there(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        file = tmp_path / "a.json"
        write_json(file, {"a": 1})

        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(output.os, "fsync", full)
        with pytest.raises(SurefootError, match=r"--json .*a.json: cannot be written: No space left"):
            write_json(file, {"a": 2})
        assert json.loads(file.read_text()) == {"a": 1}
        assert [path.name for path in tmp_path.iterdir()] == ["a.json"], "nothing half-written beside it"

    def test_bad_places_are_named_before_time_is_spent(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        for place, why in ((tmp_path, "is a folder"), (tmp_path / "file" / "a.json", "a directory|Not a|File exists")):
            with pytest.raises(SurefootError, match=f"--json .*{why}"):
                require_writable(place)
        require_writable(STDOUT)

    @pytest.mark.parametrize(
        "words",
        [
            ["latency"],
            ["rehearse"],
            ["demo"],
            ["record", "--duration", "0"],
            ["campaign"],
            ["up"],
            ["info", "IN"],
            ["keys", "show", "--keys", "."],
        ],
    )
    def test_a_bad_path_is_one_line_and_starts_nothing(
        self, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "file").write_text("")
        (tmp_path / "walk.mcap").write_bytes(b"\x89MCAP0\r\n")
        monkeypatch.chdir(tmp_path)
        before = sorted(path.name for path in tmp_path.iterdir())
        words = [word.replace("IN", "walk.mcap") for word in words]
        assert main([*words, "--json", str(tmp_path / "file" / "a.json")]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        assert "--json" in said.err
        assert sorted(path.name for path in tmp_path.iterdir()) == before


class TestUp:
    """`surefoot up --json FILE` writes beside what is shown."""

    def test_records_go_to_a_file_while_another_display_shows(self, tmp_path: Path) -> None:
        seen: list[str] = []

        class Shown:
            def __enter__(self) -> Shown:
                return self

            def __exit__(self, *error: object) -> None:
                seen.append("end")

            def show(self, *_: object) -> None:
                seen.append("shown")

            def say(self, _elapsed_s: float, text: str) -> None:
                seen.append(text)

        file = tmp_path / "up.jsonl"
        with Several(Shown(), JsonLines(file)) as both:
            both.say(1.0, "the end")
            assert json.loads(file.read_text()) == {"elapsed_s": 1.0, "event": "the end"}, "a line is there at once"
        assert seen == ["the end", "end"]


def run(words: list[str], **environment: str) -> tuple[str, str]:
    """Run a command on a terminal; return what it showed there, and what went to a piped stderr."""
    ours, its = pty.openpty()
    env = {**{name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")},
           "TERM": "xterm-256color", "COLUMNS": "100", **environment}  # fmt: skip
    process = subprocess.Popen([*SUREFOOT, *words], stdout=its, stderr=subprocess.PIPE, env=env, text=True)
    os.close(its)
    shown = b""
    try:
        while piece := os.read(ours, 65536):
            shown += piece
    except OSError:  # how the end of a terminal is told
        pass
    os.close(ours)
    assert process.stderr is not None
    with process.stderr:
        errors = process.stderr.read()
    assert process.wait(60) == 0
    return shown.decode(), errors


def test_colours_on_a_terminal_unless_somebody_minds() -> None:
    colour = re.compile(r"\x1b\[[0-9;]*\b(3[0-7]|9[0-7]|38;)[0-9;]*m")
    assert colour.search(run(["--help"])[0])
    shown, errors = run(["--help"], NO_COLOR="1")
    assert not colour.search(shown)
    assert errors == ""


@pytest.mark.parametrize("words", [["--help"], ["config"], ["config", "--json", "-"]])
def test_a_pipe_that_nobody_reads_ends_it_quietly(words: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*SUREFOOT, *words], stdout=writing, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (ExitCode.READER_GONE, b"")


def breaks_another_pipe() -> None:
    raise BrokenPipeError("of a worker")


def has_a_fault() -> None:
    raise ZeroDivisionError("of ours")


def prints_a_table() -> None:
    result("[brackets] are no markup", "x" * 300)


@pytest.fixture
def _commands(monkeypatch: pytest.MonkeyPatch) -> None:
    functions = (breaks_another_pipe, has_a_fault, prints_a_table)
    table = {function.__name__: Command(f"{__name__}:{function.__name__}", "Is a test.") for function in functions}
    monkeypatch.setattr(cli, "COMMANDS", table)


@pytest.mark.usefixtures("_commands")
@pytest.mark.parametrize(("name", "what"), [("breaks_another_pipe", "of a worker"), ("has_a_fault", "of ours")])
def test_our_own_faults_are_told_with_their_traceback(name: str, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name]) in {ExitCode.FAULT}
    said = capsys.readouterr()
    if name == "has_a_fault":
        assert "Traceback" in said.err
        assert said.err.splitlines()[-1].startswith("surefoot: this is a fault of Surefoot")
        assert what in said.err
    assert said.out == ""


@pytest.mark.usefixtures("_commands")
def test_lines_are_neither_folded_nor_marked_up(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prints_a_table"]) == 0
    assert capsys.readouterr().out.splitlines() == ["[brackets] are no markup", "x" * 300]
