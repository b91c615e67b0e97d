"""Reading the configuration file, with errors a person can act on."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from bridge.config.surefoot import SurefootConfig
from bridge.config.version import VERSION, hint, migrated, version_of
from bridge.errors import ConfigError


def load_config(path: Path | None, overrides: Sequence[str] = ()) -> SurefootConfig:
    """Return the configuration in `path`, with `section.key=value` overrides applied on top.

    Args:
        path: TOML file; None means the defaults. One of an older version is migrated, and a hint is logged.
        overrides: values are read as TOML, or as plain text where they are not TOML.

    Raises:
        ConfigError: names the file, the key, the value and what was expected.
    """
    name = "defaults" if path is None else str(path)
    table = {} if path is None else parse_text(read_text(path), name)
    version = version_of(table, name) if table else VERSION
    table, _ = migrated(table, name)
    for override in overrides:
        _apply(table, override)
    config = parse_config(table, name)
    if version < VERSION:
        hint(path, version)
    return config


def parse_config(table: Mapping[str, Any], name: str) -> SurefootConfig:
    """Validate an already read table of the present version; `name` is what errors call it."""
    version_of(table, name)
    try:
        return SurefootConfig.model_validate(table)
    except ValidationError as error:
        raise ConfigError(f"{name}: {_explain(error)}") from error


def read_text(path: Path) -> str:
    """Return the text of a configuration file.

    Raises:
        ConfigError: it is not there, or cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such configuration file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def parse_text(text: str, name: str) -> dict[str, Any]:
    """Return the table in `text`.

    Raises:
        ConfigError: it is no TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: not valid TOML: {error}") from error


def _apply(table: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    names = key.strip().split(".")
    if not equals or len(names) < 2 or not all(names):
        raise ConfigError(f"--set {override}: expected SECTION.KEY=VALUE")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    for name in names[:-1]:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise ConfigError(f"--set {override}: '{name}' is a value, not a section")
    table[names[-1]] = value


def _explain(error: ValidationError) -> str:
    """Return one line for the first thing wrong, and how many more there are."""
    problems = error.errors()
    first = problems[0]
    location = [str(part) for part in first["loc"]]
    key = ".".join(location)
    if first["type"] == "extra_forbidden":
        line = f"unknown key '{key}'{_nearest(location)}"
    else:
        message = first["msg"].removeprefix("Value error, ")
        shown = "" if isinstance(first["input"], dict) else f" = {first['input']!r}"
        line = f"{key}{shown}: {message[0].lower()}{message[1:]}"
    more = len(problems) - 1
    return line + (f" (and {more} more)" if more else "")


def _nearest(location: Sequence[str]) -> str:
    """Suggest the known key closest to the unknown one, in its own section first, then in all."""
    model: type[BaseModel] = SurefootConfig
    for name in location[:-1]:
        field = model.model_fields.get(name)
        if field is None or not isinstance(field.annotation, type) or not issubclass(field.annotation, BaseModel):
            return ""
        model = field.annotation
    here = difflib.get_close_matches(location[-1], model.model_fields, n=1, cutoff=0.5)
    if here:
        return f"; did you mean '{'.'.join([*location[:-1], here[0]])}'?"
    everywhere = {path.rsplit(".", 1)[-1]: path for path in _all_keys(SurefootConfig)}
    far = difflib.get_close_matches(location[-1], everywhere, n=1, cutoff=0.6)
    return f"; did you mean '{everywhere[far[0]]}'?" if far else f"; known: {', '.join(model.model_fields)}"


def _all_keys(model: type[BaseModel], prefix: str = "") -> list[str]:
    keys: list[str] = []
    for name, field in model.model_fields.items():
        keys.append(prefix + name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            keys += _all_keys(field.annotation, f"{prefix}{name}.")
    return keys
