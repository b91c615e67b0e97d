"""Versions of the configuration file: old ones are migrated and say so, newer ones are refused, comments stay."""

from __future__ import annotations

import tomllib
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

import pytest

from bridge.cli import main
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.config.template import render_template
from bridge.config.version import STEPS, VERSION, migrated, migrated_text
from bridge.errors import ConfigError

OLD = """\
# The walker in the lab.

[gate]  # of the drive
lifetime_s = 0.05  # short

# Never again without it.
[launch]
restart = true
"""


def moved(table: MutableMapping[str, Any]) -> list[str]:
    """A step such as a later version will have: a key gets another name and another section."""
    if "lifetime_s" not in table.get("gate", {}):
        return []
    table.setdefault("launch", {})["restart_limit"] = int(table["gate"].pop("lifetime_s") * 100)
    return ["gate.lifetime_s is now launch.restart_limit"]


def by_hand(table: MutableMapping[str, Any]) -> list[str]:
    raise ConfigError("gate.lifetime_s is gone: set gate.frame_age_s by what you measured")


def test_there_is_a_step_from_every_version() -> None:
    assert sorted(STEPS) == list(range(VERSION))


def test_a_step_changes_keys_and_keeps_comments() -> None:
    text, said = migrated_text(OLD, "old.toml", {0: moved})
    assert tomllib.loads(text) == {"version": VERSION, "gate": {}, "launch": {"restart": True, "restart_limit": 5}}
    assert said == ["gate.lifetime_s is now launch.restart_limit"]
    for comment in ("# The walker in the lab.", "# of the drive", "# Never again without it."):
        assert comment in text
    assert text.startswith(f"# The walker in the lab.\nversion = {VERSION}\n")
    table = tomllib.loads(OLD)
    assert migrated(table, "old.toml", {0: moved})[0] == tomllib.loads(text), "read or written, it is the same"
    assert table == tomllib.loads(OLD), "what was given stays as it is"


@pytest.mark.parametrize(
    "text",
    ["", "# only a comment\n", "[launch]\nrestart = false\n", "# of launch\n[launch]\nrestart = false\n", "\n[gate]\n"],
)
def test_the_version_is_on_top_whatever_there_was(text: str) -> None:
    written, _ = migrated_text(text, "a.toml")
    assert tomllib.loads(written) == {**tomllib.loads(text), "version": VERSION}
    assert migrated_text(written, "a.toml")[0] == written, "twice is once"


def test_what_no_step_can_do_says_what_to_do() -> None:
    with pytest.raises(ConfigError, match=r"old.toml: cannot be migrated from version 0 to 1: gate.lifetime_s is gone"):
        migrated(tomllib.loads(OLD), "old.toml", {0: by_hand})


@pytest.mark.parametrize("value", ["2", "1.0", "true", "-1", "'1'", "[1]"])
def test_newer_versions_are_refused(value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "new.toml"
    file.write_text(f"version = {value}\n[launch]\nwings = 2\n")
    expected = "of version 2, this Surefoot reads up to 1: upgrade Surefoot" if value == "2" else "expected a number"
    with pytest.raises(ConfigError, match=expected):
        load_config(file)
    for words in (["--check"], ["--migrate"]):
        assert main(["config", *words, str(file)]) == 2
        said = capsys.readouterr()
        assert expected in said.err
        assert said.out == ""


def test_the_template_says_the_version() -> None:
    assert tomllib.loads(render_template())["version"] == VERSION
    assert migrated_text(render_template(), "x")[0] == render_template()


class TestCommand:
    """`surefoot config`."""

    @pytest.fixture
    def old(self, tmp_path: Path) -> Path:
        file = tmp_path / "old.toml"
        file.write_text("# mine\n[launch]\nrestart_limit = 2 # few\n")
        return file

    def test_in_place(self, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["config", "--migrate", str(old), "--out", str(old)]) == 2
        assert "--force" in capsys.readouterr().err
        assert main(["config", "--migrate", str(old), "--out", str(old), "--force"]) == 0
        said = capsys.readouterr()
        assert said.out == ""
        assert "version 0 -> 1" in said.err
        assert "restart_limit = 2 # few" in old.read_text()
        assert load_config(old).launch.restart_limit == 2
        assert [path.name for path in old.parent.iterdir()] == ["old.toml"], "nothing temporary is left"

    def test_to_stdout(self, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
        before = old.read_bytes()
        assert main(["config", "--migrate", str(old)]) == 0
        assert tomllib.loads(capsys.readouterr().out) == {"version": 1, "launch": {"restart_limit": 2}}
        assert old.read_bytes() == before

    def test_what_does_not_hold_is_not_written(self, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
        old.write_text("[launch]\nrestart_limit = -2\n")
        out = old.with_name("new.toml")
        assert main(["config", "--migrate", str(old), "--out", str(out)]) == 2
        assert "launch.restart_limit" in capsys.readouterr().err
        assert not out.exists()

    def test_values_as_json(self, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
        import json

        assert main(["config", "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out) == SurefootConfig().model_dump(mode="json")
        assert main(["config", "--check", str(old), "--json", "-"]) == 0
        assert json.loads(capsys.readouterr().out)["launch"]["restart_limit"] == 2

    def test_options_that_do_not_go_together(self, old: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for words in (["--check", str(old), "--migrate", str(old)], ["--check", str(old), "--out", "x.toml"]):
            assert main(["config", *words]) == 2
            assert "together" in (said := capsys.readouterr().err) or "does not go with" in said
