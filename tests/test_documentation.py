"""README and docs name only commands, options, files and config keys that exist."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer
from pydantic import BaseModel

from bridge.cli import COMMANDS, _load, main
from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig

REPO = Path(__file__).resolve().parent.parent
PAGES = [REPO / "README.md", REPO / "CONTRIBUTING.md", *sorted((REPO / "docs").glob("*.md"))]
LINES = sorted(
    {
        line.split("#")[0].strip()
        for page in PAGES
        for block in re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        for line in block.splitlines()
        if re.match(r"\s*surefoot\s", line)
    }
)


def test_there_is_something_to_check() -> None:
    assert len(LINES) > 8


@pytest.mark.parametrize("line", LINES)
def test_commands_and_options_exist(
    line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", " ", line).split(">")[0].split("&&")[0].split("|")[0])
    if words[1].startswith("--"):
        assert main(words[1:]) == 0
        return
    assert words[1] in COMMANDS, line
    group = isinstance(_load(COMMANDS[words[1]].target), typer.Typer)  # its options are those of its own commands
    main([*words[1 : 3 if group else 2], "--help"])
    page = capsys.readouterr().out
    for word in words[2:]:
        if word.startswith("--"):
            assert re.search(rf"{re.escape(word)}\b", page), f"{words[1]} has no option {word}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


TABLES = [
    (page.name, text.replace("\n   ", "\n"))
    for page in PAGES
    for text in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
]


@pytest.mark.parametrize(("page", "text"), TABLES, ids=[f"{page} {index}" for index, (page, _) in enumerate(TABLES)])
def test_configurations_load(page: str, text: str) -> None:
    parse_config(tomllib.loads(text), page)


def keys(model: type[BaseModel], prefix: str) -> set[str]:
    found = set()
    for name, field in model.model_fields.items():
        found.add(prefix + name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found |= keys(field.annotation, f"{prefix}{name}.")
    return found


KNOWN = keys(SurefootConfig, "")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_config_keys_exist(page: Path) -> None:
    sections = "|".join(SurefootConfig.model_fields)
    for key in re.findall(rf"`((?:{sections})\.[a-z_.]+)`", page.read_text(encoding="utf-8")):
        module = REPO / Path(*key.split(".")[:2]).with_suffix(".py")
        package = REPO / Path(*key.split(".")[:2])
        parents = {key, key.rsplit(".", 1)[0]}  # a table such as launch.modules has keys of its own
        assert parents & KNOWN or module.is_file() or package.is_dir(), f"{page.name} names {key}"
