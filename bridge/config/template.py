"""The configuration file with every key, its default and what it means, written from the typed model itself."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from bridge.config.surefoot import SurefootConfig

_HEADER = """\
# Surefoot's configuration: every key with its default. Delete what you do not change, but for the version.
# `[intervention]` may be changed while the system runs; everything else takes effect at the next start.
"""


def render_template() -> str:
    """Return the text of a configuration file that says exactly the defaults."""
    return _HEADER + "".join(_table(SurefootConfig(), ""))


def _table(section: BaseModel, name: str) -> Iterator[str]:
    nested: list[tuple[str, BaseModel]] = []
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, BaseModel):
            nested.append((f"{name}.{key}" if name else key, value))
            continue
        for line in textwrap.wrap(" ".join((field.description or "").split()), 110):
            yield f"# {line}\n"
        yield f"{key} = {render_value(value)}\n"
    for key, child in nested:
        yield f"\n[{key}]\n"
        yield from _table(child, key)


def render_value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return (
            "{ " + ", ".join(f"{key} = {render_value(item)}" for key, item in value.items()) + " }" if value else "{}"
        )
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(render_value(item) for item in value) + "]"
    return repr(value)
