"""What stands behind a field of a class is its description (a Griffe extension): `width: int  # [px]`."""

from __future__ import annotations

import io
import tokenize
from typing import Any

import griffe


class FieldComments(griffe.Extension):
    """Gives every attribute without a docstring the comment at its line's end."""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Take the comment over."""
        if attr.docstring is not None or attr.lineno is None or not isinstance(attr.parent, griffe.Class):
            return
        said = comment("\n".join(attr.lines))
        if said:
            attr.docstring = griffe.Docstring(said, lineno=attr.lineno, parent=attr)


def comment(source: str) -> str:
    """Return the last comment of a statement, without its sign; empty if there is none or it is for a tool."""
    found = ""
    try:
        for token in tokenize.generate_tokens(io.StringIO(source.strip()).readline):
            if token.type == tokenize.COMMENT:
                found = token.string.lstrip("# ")
    except tokenize.TokenError:
        return ""
    return "" if found.startswith(("noqa", "type:")) else found
