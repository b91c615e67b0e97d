"""Every command in README and docs is executed, here or by `make test-docs`; ways.py names the others with reasons.

What takes long is parsed here: its options, their values and its files must exist.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from documented import PAGES as FILES
from documented import Documented, documented, stray
from execution import NotAsDocumentedError, execute, parse, places, recipe
from stand_ins import furnish
from ways import WAYS, way

COMMANDS = documented()
PAGES = list(dict.fromkeys(command.page for command in COMMANDS))


@pytest.fixture(scope="module")
def furnished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("documentation") / "folder"
    furnish(folder)
    return folder


def judged() -> list[Documented]:
    """Return the documented commands, and the lines of the recipes of every `make` among them."""
    made = [line for command in COMMANDS if command.words[0] == "make" for line in recipe(command.words[1:])]
    return [*COMMANDS, *dict.fromkeys(made)]


def test_there_is_something_to_execute() -> None:
    assert len(COMMANDS) > 60
    assert {"README.md", "docs/start.md", "docs/recording.md"} <= set(PAGES)


def test_commands_stand_where_they_are_found() -> None:
    assert {str(page): found for page in FILES if (found := stray(page.read_text(encoding="utf-8")))} == {}
    assert stray("```\nsurefoot up\n```\n\n    make test\n\n```sh\nsurefoot up\n```\n") == ["surefoot up", "make test"]


def test_options_values_and_files_of_every_command_exist(furnished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(furnished)
    problems = []
    for command in {command.text: command for command in judged()}.values():
        try:
            parse(command)
        except NotAsDocumentedError as error:
            problems.append(str(error))
    assert not problems, "\n".join(problems)


def test_every_exception_is_one_and_says_why() -> None:
    texts = {command.text for command in judged()}
    for pattern, known in WAYS.items():
        assert known.why, pattern
        assert any(way(text) is known for text in texts), (
            f"no documented command is like {pattern}: take it out of ways.py"
        )


@pytest.mark.parametrize("page", PAGES)
def test_quick_commands_do_what_the_page_says(page: str, furnished: Path, tmp_path: Path) -> None:
    quick = [
        command
        for command in COMMANDS
        if command.page == page and not command.is_name and command.words[0] != "make"
        if not (way(command.text).never or way(command.text).long or way(command.text).beside)
    ]
    if not quick:
        return
    folder = shutil.copytree(furnished, tmp_path / "folder")
    for command in quick:
        execute(command, folder, places())


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_commands_beside_a_running_system(furnished: Path, tmp_path: Path) -> None:
    beside = {command.text: command for command in COMMANDS if way(command.text).beside}
    assert beside
    folder = shutil.copytree(furnished, tmp_path / "folder")
    with system(folder, wire := places()["wire"]):
        for command in beside.values():
            execute(command, folder, {"beside": wire})
    assert (folder / "walk.mcap").stat().st_size > 10_000


@contextmanager
def system(folder: Path, wire: str) -> Iterator[None]:
    """The whole system on a short clip, at work."""
    words = [sys.executable, "-m", "bridge.cli", "up", "--source", "clip.npz:walk", "--controller", "log"]
    words += ["--keep-running", "--json", "-", *wire.split()]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        try:
            begun = time.monotonic()
            for line in process.stdout:
                if json.loads(line).get("command"):
                    break
                assert time.monotonic() - begun < 200, "the system never said a command"
            yield
        finally:
            process.terminate()
            process.stdout.close()
            process.wait(60)


def test_a_wrong_option_is_noticed(furnished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(furnished)
    for text in (
        "surefoot assess clips.npz --out o.npz --wibble",
        "surefoot wibble",
        "surefoot keys wibble",
        "surefoot campaign --scenarios many",
        "python -m benchmarks.fuzz --wibble",
        "python -m benchmarks.wibble",
        "make wibble",
        "pip install 'surefoot[wibble]'",
        "torchrun --nproc-per-node 2 --no-python surefoot train --wibble",
    ):
        with pytest.raises(NotAsDocumentedError):
            parse(Documented("page", text))


def test_a_program_that_is_not_known_must_be_named(tmp_path: Path) -> None:
    with pytest.raises(NotAsDocumentedError, match=r"ways\.py"):
        execute(Documented("page", "wibble --all"), tmp_path, {})


def test_a_failing_command_is_noticed(tmp_path: Path) -> None:
    with pytest.raises(NotAsDocumentedError, match="exit code 2"):
        execute(Documented("page", "surefoot info missing.mcap"), tmp_path, {})
