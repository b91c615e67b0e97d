"""What the shell is offered, by the protocol that shells speak, and by Bash itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from bridge import cli
from bridge.cli import COMMANDS, main
from bridge.command_line.completion import join_broken, settings
from bridge.config.load import load_config
from bridge.config.template import render_template

BREAKS = "=:"


def offered(line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return what Bash is offered at the end of `line`, which it breaks into words at = and : too."""
    words: list[str] = []
    for word in line.split(" "):
        pieces, piece = [], ""
        for sign in word:
            if sign in BREAKS:
                pieces, piece = [*pieces, *([piece] if piece else []), sign], ""
            else:
                piece += sign
        words += [*pieces, piece] if piece or not pieces else pieces
    monkeypatch.setenv("_SUREFOOT_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "\n".join(words))
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    monkeypatch.setattr(sys, "argv", ["surefoot"])
    capsys.readouterr()
    assert main() == 0
    said = capsys.readouterr()
    assert said.err == ""
    return said.out.splitlines()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("surefoot la", {"latency"}),
        ("surefoot keys is", {"issue"}),
        ("surefoot info --js", {"--json"}),
        ("surefoot keys issue ani", set()),
        ("surefoot keys issue anti", {"anticipation"}),
        ("surefoot keys zenoh rou", {"router"}),
        ("surefoot up --controller ", {"mpc", "log"}),
        ("surefoot up --estimator m", {"movenet"}),
        ("surefoot up --roles perc", {"perception"}),
        ("surefoot up --roles perception,contr", {"perception,controller"}),
        ("surefoot record --topics keypoints,fall", {"keypoints,fall_horizon"}),
        ("surefoot up --set launch.restart_w", {"launch.restart_window_s=", "launch.restart_window_s=30.0"}),
        ("surefoot up --set bridge.naming=", {"ros2dds", "rmw_zenoh"}),
        ("surefoot up --set bridge.naming=rm", {"rmw_zenoh"}),
        ("surefoot up --set=bridge.naming=rm", {"rmw_zenoh"}),
        ("surefoot up --set launch.restart=", {"true", "false"}),
        ("surefoot up --set launch.restart=t --set bridge.mode=c", {"client"}),
        ("surefoot up --set version", set()),
        ("surefoot up --set wings", set()),
    ],
)
def test_offers(
    line: str, expected: set[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert set(offered(line, monkeypatch, capsys)) == expected


def test_every_command_is_offered(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert set(offered("surefoot ", monkeypatch, capsys)) == set(COMMANDS)


def test_a_command_whose_name_is_being_written_is_not_loaded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "_load", lambda target: pytest.fail(f"loaded {target}"))
    assert offered("surefoot evaluate", monkeypatch, capsys) == ["evaluate"]


@pytest.mark.parametrize(("line", "expected"), [("surefoot lat", "latency"), ("surefoot info --js", "--json")])
def test_zsh_asks_in_another_way(
    line: str, expected: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_SUREFOOT_COMPLETE", "complete_zsh")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
    monkeypatch.setattr(sys, "argv", ["surefoot"])
    assert main() == 0
    assert expected in capsys.readouterr().out


def test_clips_of_a_keypoint_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    np.savez(tmp_path / "clips.npz", **{"walk/keypoints": np.zeros(1), "fall-3/keypoints": np.zeros(1), "x": 0})
    monkeypatch.chdir(tmp_path)
    assert offered("surefoot up --source clips.npz:", monkeypatch, capsys) == ["fall-3", "walk"]
    assert offered("surefoot up --source clips.npz:w", monkeypatch, capsys) == ["walk"]
    assert offered("surefoot up --source absent.npz:w", monkeypatch, capsys) == []


def test_every_key_is_offered_and_can_be_set() -> None:
    def keys(table: dict[str, object], prefix: str = "") -> set[str]:
        found = set()
        for name, value in table.items():
            found |= keys(value, f"{prefix}{name}.") if isinstance(value, dict) and value else {prefix + name}
        return found

    known = {key for key in keys(tomllib.loads(render_template())) if "." in key}
    offers = {offer.removesuffix("=") for offer in settings("")}
    empty = {key for key in known - offers if not load_config(None).model_dump()[key.split(".")[0]][key.split(".")[1]]}
    assert known - offers == empty, "only tables that are empty have nothing to offer"
    for key in offers:
        for offer in settings(f"{key}=") if key not in NEEDS_MORE else ():
            load_config(None, [offer])


NEEDS_MORE = {"bridge.mode"}  # 'client' needs a router


@pytest.mark.parametrize(
    ("words", "position", "joined", "where"),
    [
        (["a", "b"], 1, ["a", "b"], 1),
        (["a", "k", "=", "v"], 3, ["a", "k=v"], 1),
        (["a", "k", "="], 2, ["a", "k="], 1),
        (["a", "f", ":", "c", "--x"], 3, ["a", "f:c", "--x"], 1),
        (["a", "--set", "=", "k", "=", "v"], 5, ["a", "--set", "k=v"], 2),
        (["a", "--json", "="], 2, ["a", "--json"], 2),
        (["a", "k", "=", "v"], 4, ["a", "k=v"], 2),
    ],
)
def test_words_that_bash_broke_are_whole_again(words: list[str], position: int, joined: list[str], where: int) -> None:
    assert join_broken(words, position) == (joined, where)


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no Bash here")
def test_bash_itself(tmp_path: Path) -> None:
    """The script that is printed and installed, run by Bash as it does when Tab is pressed."""
    (tmp_path / "surefoot").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m bridge.cli "$@"\n')
    (tmp_path / "surefoot").chmod(0o755)
    script = """
    surefoot --install-completion bash > installed && surefoot --show-completion bash > shown || exit 3
    source ~/.bashrc
    complete -p surefoot | grep -q _surefoot_completion || exit 4
    grep -q '_surefoot_completion()' shown || exit 5
    COMP_WORDS=(surefoot up --set bridge.naming = rm); COMP_CWORD=5
    _surefoot_completion surefoot
    printf '%s\\n' "${COMPREPLY[@]}"
    """
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    environment = {
        **os.environ,
        "PATH": path,
        "HOME": str(tmp_path),
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
    }
    done = subprocess.run(
        ["bash", "--norc", "--noprofile", "-c", script],
        env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "rmw_zenoh\n", "")
