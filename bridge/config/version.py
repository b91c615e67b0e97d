"""The version of the configuration file, and the way from each older one to the next.

A file says `version = N` at its top. One of an older version is migrated step by step when it is read, and
`surefoot config --migrate` writes it anew with its comments; one of a newer version is refused, because what
its keys mean is not known here. A file that says nothing is of version 0: those from before there were versions.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any, Final

import tomlkit
from tomlkit.exceptions import TOMLKitError

from bridge.errors import ConfigError

VERSION: Final = 1
KEY: Final = "version"

Step = Callable[[MutableMapping[str, Any]], list[str]]  # changes a table it is given, says what it changed


def _named(table: MutableMapping[str, Any]) -> list[str]:
    """Version 0 to 1: the same keys, and the version is said."""
    del table
    return []


STEPS: Final[Mapping[int, Step]] = {0: _named}  # from version N to N + 1


def version_of(table: Mapping[str, Any], name: str) -> int:
    """Return the version of a configuration; 0 if it does not say.

    Raises:
        ConfigError: it is newer than this Surefoot, or no version at all.
    """
    found = table.get(KEY, 0)
    if not isinstance(found, int) or isinstance(found, bool) or found < 0:
        raise ConfigError(f"{name}: version = {found!r}: expected a number from 1 to {VERSION}")
    if found > VERSION:
        raise ConfigError(
            f"{name}: is of version {found}, this Surefoot reads up to {VERSION}: upgrade Surefoot, or begin a new"
            " file with `surefoot config`"
        )
    return int(found)


def migrated(
    table: Mapping[str, Any], name: str, steps: Mapping[int, Step] = STEPS
) -> tuple[dict[str, Any], list[str]]:
    """Return `table` as the present version has it, and what was changed; `table` stays as it is.

    Raises:
        ConfigError: it is newer than this Surefoot, or a step cannot do it alone and says what to do.
    """
    new = copy.deepcopy(dict(table))
    said = _migrate(new, name, steps)
    new[KEY] = VERSION
    return new, said


def migrated_text(text: str, name: str, steps: Mapping[int, Step] = STEPS) -> tuple[str, list[str]]:
    """Return the text of a file as the present version has it, with its comments, and what was changed.

    Raises:
        ConfigError: no TOML, newer than this Surefoot, or a step cannot do it alone.
    """
    try:
        document = tomlkit.parse(text)
    except TOMLKitError as error:
        raise ConfigError(f"{name}: not valid TOML: {error}") from error
    said = _migrate(document, name, steps)
    if KEY not in document:  # tomlkit would put it behind the last key that stands in no section
        return _on_top(f"{KEY} = {VERSION}", tomlkit.dumps(document)), said
    document[KEY] = VERSION
    return tomlkit.dumps(document), said


def hint(path: Any, version: int) -> None:
    """Tell, once for each file, that it is of an older version."""
    if (path, version) in _TOLD:
        return
    _TOLD.add((path, version))
    how = f"surefoot config --migrate {path} --out {path} --force"
    what = "says no version and is read as it is" if version == 0 else f"is of version {version} and was migrated"
    logging.getLogger("surefoot.config").warning("%s: %s; to write version = %d into it: %s", path, what, VERSION, how)


_TOLD: Final[set[tuple[Any, int]]] = set()


def _migrate(table: MutableMapping[str, Any], name: str, steps: Mapping[int, Step]) -> list[str]:
    said: list[str] = []
    for version in range(version_of(table, name), VERSION):
        try:
            said += steps[version](table)
        except ConfigError as error:
            raise ConfigError(f"{name}: cannot be migrated from version {version} to {version + 1}: {error}") from error
    return said


def _on_top(line: str, text: str) -> str:
    """Return `text` with `line` below the comment it begins with."""
    lines = text.splitlines(keepends=True)
    head = 0
    while head < len(lines) and lines[head].startswith("#"):
        head += 1
    if head < len(lines) and lines[head].strip():  # this comment belongs to what follows it
        head = 0
    return "".join([*lines[:head], f"{line}\n", *lines[head:]])
