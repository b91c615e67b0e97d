"""Writing tuned thresholds into a user's TOML file, which stays theirs: order, comments and everything else."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from bridge.config.intervention import InterventionConfig
from bridge.config.load import parse_config, read_text
from bridge.config.version import migrated_text
from bridge.errors import ConfigError, MissingExtraError, SurefootError

SECTION: Final = "intervention"
NOTE: Final = "# tuned: "  # begins the lines at the top of the file that say where the values come from
_DEFAULTS: Final = InterventionConfig()
_WAS: Final = re.compile(r"^was [^;]*(; )?")


def write_toml(
    source: Path | None,
    out: Path,
    changes: Mapping[str, float | int],
    *,
    note: Sequence[str] = (),
    force: bool = False,
) -> None:
    """Write `source` with other thresholds to `out`, whole or not at all.

    Args:
        source: the user's file; None: there is none, everything else has its default.
        out: where to; may be `source` itself, with `force`.
        changes: keys of `[intervention]` and their new values; a key that keeps its value is left as it is.
        note: lines that say where the values come from; they become comments at the top, in place of earlier ones.
        force: overwrite what is at `out`.

    Raises:
        ConfigError: `source` cannot be read or the result does not hold together.
        SurefootError: `out` is taken, or cannot be written.
    """
    if out.exists() and not force:
        raise SurefootError(f"{out}: is there already; --force overwrites it")
    text = tuned_text(source, changes, note)
    part = out.with_name(f".{out.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(out)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SurefootError(f"{out}: cannot be written: {error.strerror}") from error


def require_tomlkit() -> None:
    """Raise `MissingExtraError` where the package that keeps comments is not installed."""
    if find_spec("tomlkit") is None:
        raise MissingExtraError("writing a configuration", "tomlkit", "tune")


def tuned_text(source: Path | None, changes: Mapping[str, float | int], note: Sequence[str] = ()) -> str:
    """Return the text that `write_toml` writes.

    Raises:
        ConfigError: `source` cannot be read or the result does not hold together.
        MissingExtraError: the package that keeps comments is not installed.
    """
    require_tomlkit()
    import tomlkit  # noqa: PLC0415 (an extra)
    from tomlkit.exceptions import TOMLKitError  # noqa: PLC0415

    name = "defaults" if source is None else str(source)
    try:
        document: Any = tomlkit.parse(migrated_text("" if source is None else read_text(source), name)[0])
    except TOMLKitError as error:
        raise ConfigError(f"{name}: cannot be read: {error}") from error
    parse_config(document.unwrap(), name)  # what is wrong already is not our doing
    if SECTION not in document:
        if document.body:
            document.add(tomlkit.nl())
        document.add(SECTION, tomlkit.table())
    table = document[SECTION]
    for key, value in changes.items():
        if key not in InterventionConfig.model_fields:
            raise ConfigError(f"{name}: unknown key '{SECTION}.{key}'")
        present, default = table.get(key), getattr(_DEFAULTS, key)
        if (default if present is None else present) != value:
            _put(table, key, value, f"was {default:g}, the default" if present is None else f"was {present:g}")
    lines = [line for line in tomlkit.dumps(document).splitlines(keepends=True) if not line.startswith(NOTE)]
    text = "".join([f"{NOTE}{line}\n" for line in note] + lines)
    parse_config(tomllib.loads(text), name)
    return text


def _put(table: Any, key: str, value: float, remark: str) -> None:
    import tomlkit  # noqa: PLC0415 (an extra)
    from tomlkit.items import InlineTable  # noqa: PLC0415

    kept = "" if key not in table else _WAS.sub("", table[key].trivia.comment.lstrip("# ").strip())
    item: Any = tomlkit.item(value)
    if isinstance(table, InlineTable):  # has no room for comments
        table[key] = item
    elif key in table:
        table[key] = item
        table[key].comment(f"{remark}; {kept}" if kept else remark)
        table[key].trivia.comment_ws = "  "
    else:
        item.comment(remark)
        item.trivia.comment_ws = "  "
        table.add(key, item)
