"""What `make test-docs` adds to the tests: the documented commands that take long, with their cheapest options.

Real processes, ports of their own, stand-in files. What learns needs the research data and is skipped without it.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from documented import Documented, documented
from execution import execute, places, recipe
from stand_ins import furnish
from ways import way

COMMANDS = documented()
PAGES = list(dict.fromkeys(command.page for command in COMMANDS))
TARGETS = list(dict.fromkeys(command.text for command in COMMANDS if command.words[0] == "make"))

pytestmark = [pytest.mark.processes, pytest.mark.timeout(1800)]


@pytest.fixture(scope="module")
def furnished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("documentation") / "folder"
    furnish(folder)
    return folder


@pytest.fixture
def folder(furnished: Path, tmp_path: Path) -> Path:
    return shutil.copytree(furnished, tmp_path / "folder")


def is_long(command: Documented) -> bool:
    known = way(command.text)
    return known.long and not known.never and not command.is_name


@pytest.mark.parametrize("page", [page for page in PAGES if any(is_long(c) for c in COMMANDS if c.page == page)])
def test_long_commands_do_what_the_page_says(
    page: str, folder: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the page's order, with the quick ones between, whose files they may need."""
    commands = [command for command in COMMANDS if command.page == page and not command.is_name]
    data = ""
    if any(way(command.text).data for command in commands if is_long(command)):
        data = str(request.getfixturevalue("data_dir").resolve())
        monkeypatch.setenv("SUREFOOT_DATA", data)
    for command in commands:
        known = way(command.text)
        if not (known.never or known.beside or command.words[0] == "make"):
            execute(command, folder, {**places(), "data": data}, apart=known.long)


@pytest.mark.parametrize("target", TARGETS)
def test_what_make_runs_does_run(target: str, folder: Path) -> None:
    for line in recipe(target.split()[1:]):
        if is_long(line):
            execute(line, folder, places(), apart=True)
