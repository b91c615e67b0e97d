"""The command line: lazy commands, one-line errors, exit codes."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import pytest
import typer

from bridge import cli
from bridge.cli import COMMANDS, Command, main
from bridge.errors import SourceError
from bridge.launch import command as up_command


def raises_source_error() -> None:
    raise SourceError("clip.npz:\n  no such clip")


def interrupted() -> None:
    raise KeyboardInterrupt


def counts(number: Annotated[int, typer.Option(help="a number")] = 0) -> int:
    """Return its number.

    In two paragraphs.
    """
    return number


def leaves() -> None:
    raise typer.Exit(7)


def says_nothing() -> None:
    pass


@pytest.fixture
def _commands(monkeypatch: pytest.MonkeyPatch) -> None:
    functions = (raises_source_error, interrupted, counts, leaves, says_nothing)
    table = {function.__name__: Command(f"{__name__}:{function.__name__}", "Is a test.") for function in functions}
    table["absent"] = Command("no.such.module:function", "Is never loaded.")
    monkeypatch.setattr(cli, "COMMANDS", table)


@pytest.mark.usefixtures("_commands")
@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["counts"], 0),
        (["counts", "--number", "5"], 5),
        (["leaves"], 7),
        (["says_nothing"], 0),
        (["interrupted"], 130),
        (["--help"], 0),
        (["counts", "--help"], 0),
        ([], 0),
    ],
)
def test_what_a_command_returns_is_the_exit_code(
    arguments: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == code
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("_commands")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["raises_source_error"], "clip.npz: no such clip"),
        (["counts", "--number", "five"], "--number"),
        (["counts", "--nmber", "5"], "--nmber"),
        (["counts", "--number"], "--number"),
        (["coutns"], "counts"),
        (["--wrong"], "--wrong"),
        (["counts", "left over"], "left over"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("surefoot: ")
    assert errors.count("\n") == 1
    assert words in errors
    assert "Traceback" not in errors


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"surefoot {version('surefoot')}\n"


def test_every_command_is_listed_with_its_purpose(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--help"])
    shown = " ".join(capsys.readouterr().out.split())
    for name, command in COMMANDS.items():
        assert name in shown
        assert command.purpose.split(",")[0].split()[0] in shown


def test_help_loads_neither_networks_nor_solvers_nor_the_wire() -> None:
    heavy = ("torch", "casadi", "osqp", "pinocchio", "zenoh", "sklearn", "matplotlib", "perception", "controller")
    code = f"import sys; from bridge.cli import main; main(['--help']); print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "[]"


class TestUp:
    """What `surefoot up` refuses before anything starts."""

    @pytest.fixture(autouse=True)
    def _elsewhere(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(up_command, "Launcher", self.fail)

    @staticmethod
    def fail(*_: object) -> None:
        raise AssertionError("started something")

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["--config", "absent.toml"], "absent.toml"),
            (["--set", "launch.restrat=false"], "launch.restart"),
            (["--set", "launch"], "SECTION.KEY=VALUE"),
            (["--roles", "perception,cook"], "cook"),
            (["--roles", "drive,drive"], "more than once"),
            (["--roles", ","], "roles is empty"),
            (["--roles", "drive", "--source", "x.npz:walk"], "--source is for perception"),
            (["--roles", "drive", "--controller", "log"], "--controller is for controller"),
            (["--controller", "psychic"], "psychic"),
            (["--duration", "-1"], "--duration"),
            (["--duration", "soon"], "--duration"),
        ],
    )
    def test_bad_options(self, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["up", *arguments]) == 2
        errors = capsys.readouterr().err
        assert errors.count("\n") == 1
        assert words in errors

    def test_default_config_is_read_where_it_is(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (tmp_path / "config").mkdir()
        (tmp_path / "config" / "surefoot.toml").write_text("[launch]\nrestart_limit = -1\n")
        assert main(["up"]) == 2
        assert "config/surefoot.toml: launch.restart_limit" in capsys.readouterr().err
