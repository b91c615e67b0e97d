"""The conventions of all commands, over the table of commands: a new one cannot come without them."""

from __future__ import annotations

import ast
import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import typer
from bridge_recordings import walk, write

from bridge.cli import COMMANDS, _app, main
from bridge.command_line import options
from bridge.exit_codes import MEANINGS, ExitCode

REPO = Path(__file__).resolve().parent.parent.parent
PACKAGES = ("perception", "anticipation", "bridge", "controller", "simulation")
PAGES = [REPO / "README.md", *sorted((REPO / "docs").glob("*.md"))]

SHARED = {  # option -> what every command that has it takes from bridge.command_line.options
    "--config": options.ConfigOption,
    "--set": options.SetOption,
    "--force": options.ForceOption,
    "--seed": options.SeedOption,
    "--jobs": options.JobsOption,
    "--data": options.DataOption,
    "--controller": options.ControllerOption,
    "--topics": options.TopicsOption,
    "--crop": options.CropOption,
    "--json": options.JsonOption,
    "--duration": options.DurationOption,
}
OWN_WORDS = {  # where a shared option has another text, and why
    ("up", "--json"): "it runs until it is stopped, so it writes a record a second",
    ("latency", "--duration"): "it has a default: without an end there is no result",
}
OTHER_NAMES = {  # what our options are called elsewhere, and must not be called here too
    "--output": "--out", "--output-dir": "--out", "--save": "--out", "--report": "--out", "--dest": "--out",
    "--overwrite": "--force", "--yes": "--force", "--seconds": "--duration", "--time": "--duration",
    "--workers": "--jobs", "--processes": "--jobs", "--n-jobs": "--jobs", "--threads": "--jobs",
    "--cfg": "--config", "--configuration": "--config", "--override": "--set", "--random-seed": "--seed",
    "--json-file": "--json", "--format": "--json", "--weights": "--checkpoint", "--model": "--checkpoint",
    "--dataset": "--data", "--data-dir": "--data",
}  # fmt: skip
ALLOWED = {("tune", "--report")}  # a page beside the result, which is --out
NO_JSON = {  # commands whose result is no number a script would read, and why
    "codegen": "writes a folder of C",
    "router": "runs until it is stopped",
    "view": "shows pictures",
    "train": "writes a checkpoint; its metrics are in the header",
    "clips": "writes recordings; its facts are in them",
    "keys init": "writes files",
    "keys issue": "writes files",
    "keys zenoh": "is JSON",
}


def commands() -> Iterator[tuple[str, Any]]:
    """Give every command under the name that it is called by, those of groups too."""
    for name in COMMANDS:
        whole: Any = typer.main.get_command(_app([name]))
        found = whole.commands[name]
        below = getattr(found, "commands", None)
        if below is None:
            yield name, found
        else:
            yield from ((f"{name} {child}", command) for child, command in below.items())


ALL = dict(commands())


def option_names(command: Any) -> dict[str, Any]:
    return {name: param for param in command.params for name in param.opts if name.startswith("--")}


def shared_help(name: str) -> str:
    return str(get_args(SHARED[name])[1].help)


@pytest.mark.parametrize("name", ALL)
def test_help_has_an_example_whose_words_exist(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    command = ALL[name]
    said = f"{command.help or ''}\n\n{command.epilog or ''}"
    examples = [
        text.strip() for text in re.findall(r"(?m)^\s*Examples?: (.+)$", said) if text.strip().startswith("surefoot ")
    ]
    assert examples, f"surefoot {name} --help has no line 'Example: surefoot {name} ...'"
    words = shlex.split(re.split(r"&&|\||>", examples[0])[0])
    assert words[0] == "surefoot"
    assert " ".join(words[1:]).startswith(name.split(maxsplit=1)[0])
    for word in words:
        if word.startswith("--"):
            assert word.split("=")[0] in {*option_names(command), "--keys"}, f"the example of {name} has {word}"
    assert command.help.strip().splitlines()[0].endswith("."), "the first line is a sentence"


@pytest.mark.parametrize("name", COMMANDS)
def test_docs_name_it(name: str) -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert re.search(rf"\bsurefoot {name}\b", text), f"neither README nor docs say 'surefoot {name}'"


@pytest.mark.parametrize("name", ALL)
def test_options_are_called_alike_and_mean_the_same(name: str) -> None:
    for option, param in option_names(ALL[name]).items():
        if option in OTHER_NAMES and (name, option) not in ALLOWED:
            raise AssertionError(f"surefoot {name} {option}: everywhere else it is {OTHER_NAMES[option]}")
        if option in SHARED and (name, option) not in OWN_WORDS:
            assert param.help == shared_help(option), f"surefoot {name} {option}: take it from options.py"
        assert param.help, f"surefoot {name} {option} says nothing"


@pytest.mark.parametrize("name", ALL)
def test_files_and_folders_are_called_so(name: str) -> None:
    """Where a path is asked for, the help says what kind of file, or FOLDER."""
    for param in ALL[name].params:
        if "ath" in str(getattr(param.type_descriptor, "annotation", "")):
            shown = param.metavar or ""
            assert re.search(r"FILE|FOLDER|RECORDING", shown), f"surefoot {name} {param.name}: metavar {shown!r}"


@pytest.mark.parametrize("name", ALL)
def test_a_result_is_there_for_programs(name: str) -> None:
    assert ("--json" in option_names(ALL[name])) != (name in NO_JSON)


def test_exceptions_are_still_needed() -> None:
    assert set(NO_JSON) <= set(ALL)
    for name, option in [*OWN_WORDS, *ALLOWED]:
        assert option in option_names(ALL[name])


def test_exit_codes_stand_in_help_and_docs(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    assert main(["--help"]) == 0
    page = capsys.readouterr().out
    docs = (REPO / "docs" / "command-line.md").read_text(encoding="utf-8")
    assert set(MEANINGS) == set(ExitCode)
    for code, meaning in MEANINGS.items():
        assert f"{code.value} {meaning}" in page
        assert f"| {code.value} | {meaning} |" in docs


@pytest.mark.parametrize("words", [[], ["keys"]])
def test_without_a_command_there_is_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 0
    said = capsys.readouterr()
    assert "Usage: surefoot" in said.out
    assert said.err == ""


def writers(tree: ast.AST) -> Iterator[str]:
    """Give what in a file writes to the terminal by itself."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            to_stderr = any(word.arg == "file" and ast.unparse(word.value) == "sys.stderr" for word in node.keywords)
            if (called == "print" and not to_stderr) or called in {"typer.echo", "typer.secho", "Console", "Progress"}:
                yield called
        elif isinstance(node, ast.Attribute) and ast.unparse(node) in {"sys.stdout", "sys.__stdout__"}:
            yield ast.unparse(node)


MAY_WRITE = {
    "bridge/transport/wire_log.py": "leads stdout past Zenoh's own log",
    "bridge/command_line/output.py": "the one place",
    "bridge/cli.py": "--version, and the end of a pipe",
    "bridge/command_line/completion.py": "what the shell asked for",
    "bridge/launch/display.py": "the lines of surefoot up",
    "bridge/launch/command.py": "asks whether there is a screen",
    "anticipation/training/networks.py": "a progress display that is switched off",
}


def test_nobody_else_writes_to_stdout() -> None:
    for package in PACKAGES:
        for path in sorted((REPO / package).rglob("*.py")):
            place = path.relative_to(REPO).as_posix()
            if place not in MAY_WRITE:
                found = sorted(set(writers(ast.parse(path.read_text(encoding="utf-8")))))
                assert not found, f"{place} uses {', '.join(found)}: take result, note or progress from output.py"


# What a run leaves on stdout when it is piped: Call(words) -> 'json', 'text' or 'nothing'.


class Place:
    """A folder with something to work on."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def recording(self) -> str:
        file = self.folder / "walk.mcap"
        return str(file if file.exists() else write(file, walk(0.5)))

    @property
    def clip(self) -> str:
        shipped = np.load(REPO / "simulation" / "demo" / "walk-stumble-fall.npz")
        arrays = {f"walk/{name}": shipped[f"walk-stumble-fall/{name}"] for name in ("fps", "image_size")} | {
            "walk/keypoints": shipped["walk-stumble-fall/keypoints"][:40]
        }
        np.savez(self.folder / "clip.npz", **arrays)
        return str(self.folder / "clip.npz")

    @property
    def keys(self) -> str:
        folder = self.folder / "keys"
        if not folder.exists():
            assert main(["keys", "init", "--keys", str(folder)]) == 0
            assert main(["keys", "issue", "drive", "--keys", str(folder)]) == 0
        return str(folder)


Words = Callable[[Place], list[str]]
RUN_HERE: dict[str, tuple[Words, str]] = {
    "config": (lambda _: ["config", "--json", "-"], "json"),
    "assess": (lambda p: ["assess", p.clip, "--out", f"{p.folder}/r.npz", "--json", "-"], "json"),
    "info": (lambda p: ["info", p.recording, "--json", "-"], "json"),
    "record": (lambda p: ["record", "--out", f"{p.folder}/r.mcap", "--duration", "0.1", "--json", "-"], "json"),
    "replay": (
        lambda p: ["replay", p.recording, "--only", "controller", "--option", "controller=log",
                   "--as-fast-as-possible", "--json", "-"],
        "json",
    ),
    "view": (lambda p: ["view", p.recording, "--out", f"{p.folder}/walk.rrd"], "nothing"),
    "keys": (lambda p: ["keys", "show", "--keys", p.keys, "--json", "-"], "json"),
    "codegen": (lambda p: ["codegen", "--out", f"{p.folder}/c"], "nothing"),
    "doctor": (lambda _: ["doctor", "--only", "python", "--json", "-"], "json"),
}  # fmt: skip
ELSEWHERE = {  # too long for here: where it is run for real, or with toys
    "up": "bridge/test_bridge_processes_up.py",
    "rehearse": "bridge/test_bridge_demo_processes.py",
    "latency": "bridge/test_bridge_latency.py",
    "router": "bridge/test_bridge_several_machines.py",
    "data": "anticipation/test_anticipation_data_command.py",
    "train": "anticipation/test_anticipation_training_fit.py",
    "evaluate": "anticipation/test_anticipation_training_fit.py",
    "export": "anticipation/test_anticipation_export.py",
    "personalise": "controller/test_controller_personal_command.py",
}
FAKED = ("demo", "campaign", "clips", "tune")  # minutes of simulation: below with the work taken out


def test_every_command_is_run_somewhere() -> None:
    assert not set(RUN_HERE) & set(ELSEWHERE)
    assert {*RUN_HERE, *ELSEWHERE, *FAKED} == set(COMMANDS), "add what a new command leaves on a pipe"
    for name, file in ELSEWHERE.items():
        assert re.search(rf"[\"']{name}[\"']|\b{name}\(", (REPO / "tests" / file).read_text(encoding="utf-8")), file


@pytest.mark.parametrize("name", RUN_HERE)
def test_a_pipe_holds_the_result_alone(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    make, kind = RUN_HERE[name]
    words = make(Place(tmp_path))
    capfd.readouterr()
    assert main(words) == 0, capfd.readouterr().err
    out, errors = capfd.readouterr()
    assert "\x1b" not in out + errors, "no colours where nobody looks"
    if kind == "json":
        assert json.loads(out)
        assert "NaN" not in out
    else:
        assert out == ""
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert not [path for path in before if ".tmp" in path.name or path.name.endswith(".part")], "nothing half-written"


def alone(words: list[str], capfd: pytest.CaptureFixture[str]) -> Any:
    """Run with `--json -` and return what is on stdout, which is nothing but JSON."""
    capfd.readouterr()
    assert main([*words, "--json", "-"]) == 0, capfd.readouterr().err
    return json.loads(capfd.readouterr().out)


def test_demo_with_its_trials_taken_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from simulation.trial import command
    from simulation.trial.outcome import Outcome

    def trial(name: str, *_: Any) -> command.Trial:
        outcome = Outcome(0.05 if name == "held" else 0.7, 900.0, name != "held", tipped=False)
        return command.Trial(None, [], 5.0, outcome, "harness load", 0.5)  # type: ignore[arg-type]

    monkeypatch.setattr(command, "_run", trial)
    monkeypatch.setattr(command, "draw", lambda *_: None)
    words = ["demo", "--no-film", "--out", str(tmp_path)]
    told = alone(words, capfd)
    assert (told["held"]["held"], told["unheld"]["held"]) == (True, False)
    assert told["held"]["drop_m"] == 0.05
    assert main(words) == 0
    assert "pelvis drop" in capfd.readouterr().out


def test_campaign_with_its_scenarios_taken_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from simulation.campaign import command

    numbers = dict.fromkeys(command.SHOWN, float("nan"))
    summary = {"scenarios": 4, "rejected_draws": 1, "arms": {"none": numbers, "reactive": numbers}}
    monkeypatch.setattr(command, "run_campaign", lambda *_: summary)
    words = ["campaign", "--scenarios", "2", "--out", str(tmp_path)]
    told = alone(words, capfd)
    assert told["plan"]["falls"] == 2
    assert told["arms"]["none"]["falls_arrested"] is None, "what is not known is not 0"
    assert main(words) == 0
    assert "falls_arrested" in capfd.readouterr().out


def test_clips_with_their_scenarios_taken_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from simulation.campaign.clips import command

    monkeypatch.setattr(command, "work", lambda *_: iter(()))
    assert main(["clips", "--falls", "1", "--non-falls", "0", "--out", str(tmp_path / "clips")]) == 0
    said = capfd.readouterr()
    assert (said.out, "1 clips in" in said.err) == ("", True)


def test_tune_with_its_search_taken_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    from controller.tuning import command, report

    monkeypatch.setattr(command, "_work", lambda *_, **__: ([], object()))
    monkeypatch.setattr(report, "document", lambda _: {"recommended": {}})
    monkeypatch.setattr(command, "notes", lambda _: ["three recordings"])
    assert alone(["tune", "walk.mcap"], capfd) == {"recommended": {}}
