"""The site of `make docs`: every link leads somewhere, nothing is fetched from elsewhere, the reference is complete."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documented import REPO

from bridge.cli import COMMANDS
from bridge.config.surefoot import SurefootConfig
from bridge.topics import TOPICS

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

pytestmark = pytest.mark.timeout(300)  # a loaded machine takes its time to build it


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built as `make docs` builds it: a warning, such as a link or an anchor that leads nowhere, is an error."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=REPO, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def outside(site: Path) -> list[str]:
    file = REPO / "docs" / "generate" / "outside.py"
    spec = importlib.util.spec_from_file_location("outside", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: list[str] = module.outside(site)
    return found


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    assert outside(site) == []


def test_what_would_be_fetched_is_noticed(tmp_path: Path) -> None:
    page = '<link rel="stylesheet" href="https://fonts.example/f.css"><img src="//cdn.example/a.png"><a href="https://fine/">'
    (tmp_path / "page.html").write_text(page + '<pre class="mermaid">x</pre>', encoding="utf-8")
    (tmp_path / "style.css").write_text(
        "@import 'https://cdn.example/x.css'; a{background:url(b.png)}", encoding="utf-8"
    )
    assert len(outside(tmp_path)) == 4


def test_the_search_index_lies_beside_the_pages(site: Path) -> None:
    assert "within-class standard deviation" in text(site / "search" / "search_index.js")


@pytest.mark.processes
@pytest.mark.parametrize("page", ["index.html", "reference/python/controller.html"])
def test_the_search_finds_without_a_server(site: Path, tmp_path: Path, page: str) -> None:
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"no browser here: {', '.join(BROWSERS)}")
    words = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}"]
    words += ["--virtual-time-budget=20000", "--dump-dom", f"file://{site / page}?q=stiffening+profile"]
    shown = subprocess.run(words, capture_output=True, text=True, check=False, timeout=200).stdout
    found = re.search(r"([1-9]\d*) matching documents", shown)
    assert found, shown[-500:]
    assert "concepts.html" in shown[found.end() :]


def test_the_front_page_is_the_readme(site: Path) -> None:
    assert "already stiff when it arrives" in text(site / "index.html")
    assert 'href="safety.html"' in text(site / "index.html")


def test_every_command_is_in_the_reference(site: Path) -> None:
    page = text(site / "reference" / "commands.html")
    assert [name for name in COMMANDS if f"<code>surefoot {name}</code>" not in page] == []
    assert "surefoot keys issue" in page


def test_every_key_of_the_configuration_is_in_the_reference_with_its_bounds(site: Path) -> None:
    page = text(site / "reference" / "configuration.html")
    for name, field in SurefootConfig.model_fields.items():
        section = field.annotation
        if hasattr(section, "model_fields"):
            assert f"<code>[{name}]</code>" in page
            assert [key for key in section.model_fields if f"{key}</code>" not in page and f".{key}]" not in page] == []
    row = page[page.index("<code>lease_ms</code>") :]
    assert "≥ 50, ≤ 10000" in row[: row.index("</tr>")]
    assert ">ms<" in row[: row.index("</tr>")]


def test_every_topic_and_message_is_in_the_reference(site: Path) -> None:
    page = text(site / "reference" / "messages.html")
    assert [topic.key for topic in TOPICS if f"<code>surefoot/{topic.key}</code>" not in page] == []
    for file in (REPO / "bridge" / "msg").glob("*.msg"):
        assert f"surefoot_msgs/msg/{file.stem}" in page
    assert "probability of fall at the end of the horizon" in page


def test_public_interfaces_are_in_the_reference_with_their_docstrings(site: Path) -> None:
    python = site / "reference" / "python"
    for page, names in {
        "bridge": ("Transport", "Inbox", "Keypoints", "FallHorizon", "SupportCommand"),
        "perception": ("PoseEstimator", "Source", "PerceptionPipeline"),
        "anticipation": ("Predictor",),
        "controller": ("Controller", "SafetyGate"),
    }.items():
        for name in names:
            assert f".{name}" in text(python / f"{page}.html"), name
    assert "never waits for one" in text(python / "perception.html")
    assert "x, y [px], confidence; NaN where not found" in text(python / "perception.html")  # a comment behind a field
