"""Formats of a checkpoint: old ones go step by step or are refused with what helps, newer ones are refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from anticipation.checkpoint_format import FORMAT, HEADER, migrated, read_header
from bridge.errors import CheckpointError

PATH = Path("walk.safetensors")


def renamed(header: Mapping[str, Any]) -> dict[str, Any]:
    return {**{name: value for name, value in header.items() if name != "nets"}, "networks": header["nets"]}


def doubled(header: Mapping[str, Any]) -> dict[str, Any]:
    return {**header, "networks": header["networks"] * 2}


def test_steps_are_taken_one_after_the_other_and_change_nothing_they_were_given() -> None:
    old = {"format": 3, "nets": 1, "data": ["urfd"]}
    assert migrated(old, PATH, {3: renamed, 4: doubled}, latest=5) == {"format": 5, "networks": 2, "data": ["urfd"]}
    assert old == {"format": 3, "nets": 1, "data": ["urfd"]}


def test_a_step_that_is_missing_refuses_with_what_helps() -> None:
    with pytest.raises(CheckpointError, match=r"walk.* format is 3, .* reads 5: .*`surefoot train`"):
        migrated({"format": 3, "nets": 1}, PATH, {3: renamed}, latest=5)
    with pytest.raises(CheckpointError, match=r"velocity of the body's centre; make it again with `surefoot train`"):
        migrated({"format": 1}, PATH)


def test_a_newer_one_is_refused() -> None:
    with pytest.raises(CheckpointError, match=rf"format is {FORMAT + 1}, .* up to {FORMAT}: upgrade Surefoot"):
        migrated({"format": FORMAT + 1}, PATH)


@pytest.mark.parametrize("found", [None, "2", 2.0, True, 0, -1])
def test_what_is_no_format_is_named(found: object) -> None:
    with pytest.raises(CheckpointError, match="expected a number from 1"):
        migrated({"format": found}, PATH)


@pytest.mark.parametrize(
    ("metadata", "what"),
    [(None, "no 'surefoot' header"), ({}, "no 'surefoot' header"), ({HEADER: "{"}, "JSON"), ({HEADER: "[]"}, "table")],
)
def test_damaged_headers_are_named(metadata: Mapping[str, str] | None, what: str) -> None:
    with pytest.raises(CheckpointError, match=what):
        read_header(metadata, PATH)


def test_the_present_format_is_read_as_it_is() -> None:
    header = {"format": FORMAT, "window": 15}
    assert read_header({HEADER: json.dumps(header)}, PATH) == header
