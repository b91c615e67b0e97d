"""The table of every configuration key, from the typed model: default, unit, bounds, meaning."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from pydantic import BaseModel
from table import row

from bridge.config.surefoot import SurefootConfig
from bridge.config.template import render_value

UNITS: Final = {  # by the end of a key's name; what a sentence says in brackets goes first
    "s": "s", "ms": "ms", "ns": "ns", "hz": "Hz", "m": "m", "mm": "mm", "px": "px", "kg": "kg", "n": "N", "j": "J",
    "deg": "degrees", "rad": "rad", "sd": "sd", "days": "days", "rad_s": "rad/s", "m_s": "m/s", "m_s2": "m/s²",
    "per_s": "1/s", "kg_m2": "kg m²", "nm": "N m", "n_m": "N/m", "n_s_m": "N s/m", "ratio": "1",
}  # fmt: skip


def configuration_reference() -> str:
    """Return one chapter for each section, with a row for each key."""
    return "\n".join(_chapter(SurefootConfig(), ""))


def _chapter(section: BaseModel, name: str) -> Iterator[str]:
    schema = type(section).model_json_schema()
    definitions = schema.get("$defs", {})
    nested: list[tuple[str, BaseModel]] = []
    rows: list[str] = []
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, BaseModel):
            nested.append((f"{name}.{key}" if name else key, value))
            continue
        meaning = " ".join((field.description or "").split())
        said = bounds(schema["properties"][key], definitions)
        cells = (f"`{key}`", f"`{render_value(value)}`", unit(key, meaning), said, meaning)
        rows.append(row(cells))
    if name:
        yield f"{'#' * (2 + name.count('.'))} `[{name}]`\n"
        yield f"{_paragraphs(type(section))}\n"
    if rows:
        yield "| key | default | unit | bounds | meaning |\n|---|---|---|---|---|\n" + "\n".join(rows) + "\n"
    for key, child in nested:
        yield from _chapter(child, key)


def _paragraphs(section: type[BaseModel]) -> str:
    said = re.sub(r"^`\[[\w.]+\]`: ", "", (section.__doc__ or "").strip())
    return "\n".join(line.strip() for line in (said[:1].upper() + said[1:]).splitlines())


def unit(key: str, meaning: str) -> str:
    """Return the unit of a key: what its sentence says in brackets, else what its name ends in."""
    said = re.search(r"\[([^\]\[]{1,45})\]", re.sub(r"`[^`]*`", "", meaning))
    if said:
        return said[1]
    words = key.split("_")
    ends = ("_".join(words[-length:]) for length in (3, 2, 1) if length < len(words))
    return next((UNITS[end] for end in ends if end in UNITS), "")


Schema = Mapping[str, Any]


def bounds(schema: Schema, definitions: Schema) -> str:
    """Return what values a key takes, from its JSON schema."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].rsplit("/", 1)[-1]]
    for word, write in _BY_WORD.items():
        if word in schema:
            return write(schema, definitions)
    return _BY_TYPE.get(schema.get("type", ""), _interval)(schema, definitions)


def _any(schema: Schema, definitions: Schema) -> str:
    return " or ".join(dict.fromkeys(bounds(choice, definitions) for choice in schema["anyOf"]))


def _list(schema: Schema, definitions: Schema) -> str:
    each = schema.get("prefixItems") or [schema.get("items", {})]
    kinds = list(dict.fromkeys(bounds(item, definitions) for item in each))
    count = schema.get("maxItems")
    several = f"{count} of: " if count is not None and count == schema.get("minItems") else "list of: "
    return several + "; ".join(kinds)


def _table(schema: Schema, definitions: Schema) -> str:
    values = schema.get("additionalProperties")
    return f"table of {bounds(values, definitions)}" if isinstance(values, dict) else "table"


def _interval(schema: Schema, definitions: Schema) -> str:
    del definitions
    low = f"> {schema['exclusiveMinimum']:g}" if "exclusiveMinimum" in schema else ""
    low = low or (f"≥ {schema['minimum']:g}" if "minimum" in schema else "")
    high = f"< {schema['exclusiveMaximum']:g}" if "exclusiveMaximum" in schema else ""
    high = high or (f"≤ {schema['maximum']:g}" if "maximum" in schema else "")
    kind = "whole" if schema.get("type") == "integer" else "" if low or high else "number"
    return ", ".join(part for part in (kind, low, high) if part)


_BY_WORD: Final[dict[str, Callable[[Schema, Schema], str]]] = {
    "allOf": lambda schema, definitions: bounds(schema["allOf"][0], definitions),
    "anyOf": _any,
    "enum": lambda schema, _: ", ".join(f"`{value}`" for value in schema["enum"]),
    "const": lambda schema, _: f"`{schema['const']}`",
}
_BY_TYPE: Final[dict[str, Callable[[Schema, Schema], str]]] = {
    "array": _list,
    "object": _table,
    "string": lambda schema, _: f"text, `{schema['pattern']}`" if "pattern" in schema else "text",
    "boolean": lambda *_: "true, false",
    "null": lambda *_: "none",
}
