"""The rows on disk, and the table in docs/safety.md that is written from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from benchmarks.faults.judge import Outcome

RESULTS: Final = Path("runs/faults.json")


def read(file: Path) -> dict[str, Any]:
    """Return the rows by `group/row`."""
    rows: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    return rows


def merge(file: Path, outcome: Outcome) -> None:
    """Put a row in the place of an older one of that name."""
    rows = read(file)
    rows[f"{outcome.group}/{outcome.row}"] = outcome.as_json()
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_suffix(".tmp")
    beside.write_text(json.dumps(rows, indent=1) + "\n")
    beside.replace(file)


def write_table(rows: dict[str, Any]) -> None:
    raise NotImplementedError
