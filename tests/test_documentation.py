"""README and docs name only files and config keys that exist; their commands are executed in tests/documentation."""

from __future__ import annotations

import re
import textwrap
import tomllib
from pathlib import Path

import pytest
from pydantic import BaseModel

from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.topics import TOPICS

REPO = Path(__file__).resolve().parent.parent
PAGES = [REPO / "README.md", REPO / "CONTRIBUTING.md", *sorted((REPO / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


TABLES = [
    (page.name, textwrap.dedent(text))
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


def test_the_topics_of_the_wire_page_are_those_of_the_topic_table() -> None:
    rows = re.findall(
        r"^\| `surefoot/(\w+)` \| `([\w/]+)` \| (.*)$", (REPO / "docs" / "wire.md").read_text("utf-8"), re.M
    )
    said = {key: (ros_type, rest) for key, ros_type, rest in rows}
    assert set(said) == {topic.key for topic in TOPICS}
    for topic in TOPICS:
        ros_type, rest = said[topic.key]
        age = f"{topic.max_age_s:g} s" if topic.max_age_s >= 1 else f"{topic.max_age_s * 1e3:g} ms"
        assert ros_type == topic.ros_type
        assert f"| {topic.rate_hz:g} Hz | {age} |" in rest
        assert ("every role" if topic.publisher == "*" else topic.publisher) in rest
