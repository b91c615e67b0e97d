"""A setting as a configuration file: a copy of the user's own, which keeps its order and its comments."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable

from bridge.config.load import load_config, parse_config, read_text
from bridge.config.version import migrated_text
from bridge.errors import ConfigError

SECTION: Final = "admittance"


def setting_text(source: Path | None, values: Mapping[str, float], note: Sequence[str]) -> str:
    """Return the text of `source` with other values in `[admittance]`, each with the one before as a comment.

    Args:
        source: the user's file; None: there is none, everything else has its default.
        values: keys and their new values.
        note: lines that become comments at the top.

    Raises:
        ConfigError: `source` cannot be read, or the result does not hold together.
    """
    name = "defaults" if source is None else str(source)
    before = load_config(source).admittance
    text, _ = migrated_text("" if source is None else read_text(source), name)
    try:
        document: Any = tomlkit.parse(text)
    except TOMLKitError as error:
        raise ConfigError(f"{name}: not valid TOML: {error}") from error
    if SECTION not in document:
        if document.body:
            document.add(tomlkit.nl())
        document.add(SECTION, tomlkit.table())
    table = document[SECTION]
    for key, value in values.items():
        table[key] = value
        if not isinstance(table, InlineTable):  # has no room for comments
            table[key].comment(f"was {getattr(before, key):g}")
            table[key].trivia.comment_ws = "  "
    whole = "".join(f"# {line}\n" for line in note) + tomlkit.dumps(document)
    parse_config(tomllib.loads(whole), name)
    return whole


def fragment_text(source: Path | None, values: Mapping[str, float], note: Sequence[str]) -> str:
    """Return `[admittance]` with `values` alone, each with the value in `source` as a comment."""
    before = load_config(source).admittance
    lines = [*(f"# {line}" for line in note), f"[{SECTION}]"]
    lines += [f"{key} = {value!r}  # was {getattr(before, key):g}" for key, value in values.items()]
    return "\n".join(lines) + "\n"
