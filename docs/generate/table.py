"""One row of a Markdown table."""

from __future__ import annotations

import re
from collections.abc import Iterable


def row(cells: Iterable[str]) -> str:
    """Return the row; a bar inside a cell divides nothing (inside code it never does)."""
    return "| " + " | ".join(re.sub(r"(`[^`]*`)|\|", lambda found: found[1] or "\\|", cell) for cell in cells) + " |"
