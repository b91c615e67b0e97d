"""The rows on disk, and the table in docs/safety.md that is written from them."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from benchmarks.faults.judge import Outcome
from benchmarks.faults.process_rows import PROCESS_ROWS
from benchmarks.faults.stream_faults import FAULTS
from benchmarks.faults.stream_rows import NAMES

RESULTS: Final = Path("runs/faults.json")
PAGE: Final = Path("docs/safety.md")
BEGIN, END = "<!-- faults: written by make faults -->", "<!-- end of faults -->"
HEADINGS: Final = {
    "processes": "Processes killed (SIGKILL) and frozen for a second (SIGSTOP)",
    "arrest": "Killed while the person hangs in the harness",
    "company": "A second process of the same role, a second robot",
}
MISSING: Final = "-"

Row = Mapping[str, Any]


def read(file: Path) -> dict[str, Any]:
    """Return the rows by `group/row`."""
    rows: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    return rows


def merge(file: Path, outcome: Outcome) -> None:
    """Put a row in the place of an older one of that name."""
    rows = read(file)
    rows[f"{outcome.group}/{outcome.row}"] = {
        **outcome.as_json(),
        "when": time.strftime("%Y-%m-%d"),
        "cores": os.cpu_count(),
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_suffix(".tmp")
    beside.write_text(json.dumps(rows, indent=1) + "\n")
    beside.replace(file)


def write_table(rows: Mapping[str, Row], page: Path = PAGE) -> None:
    """Put the table of `rows` between the marks in `page`."""
    text = page.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise SystemExit(f"{page} has no place for the table: '{BEGIN}' ... '{END}'")
    body = "\n".join([BEGIN, *_lines(rows), END])
    beside = page.with_suffix(".tmp")
    beside.write_text(before + body + after, encoding="utf-8")
    beside.replace(page)


def _lines(rows: Mapping[str, Row]) -> Iterable[str]:
    expected = [(stream, fault.name) for stream in NAMES for fault in FAULTS]
    expected += [(row.group, row.row) for row in PROCESS_ROWS]
    there = [rows[f"{group}/{row}"] for group, row in expected if f"{group}/{row}" in rows]
    failed = sum(bool(row["problems"]) for row in there)
    when = sorted({row["when"] for row in there})
    cores = sorted({row["cores"] for row in there})
    yield ""
    yield (
        f"{len(there)} of {len(expected)} rows measured, {failed} failed; {' to '.join(sorted({when[0], when[-1]}))}, "
        f"{'/'.join(map(str, cores))} cores."
        if there
        else "Nothing measured yet."
    )
    yield from _streams(rows)
    for group, heading in HEADINGS.items():
        chosen = [
            rows[f"{group}/{row.row}"] for row in PROCESS_ROWS if row.group == group and f"{group}/{row.row}" in rows
        ]
        if chosen:
            yield from _detail(heading, chosen)
    for stream in NAMES:
        chosen = [rows[f"{stream}/{fault.name}"] for fault in FAULTS if f"{stream}/{fault.name}" in rows]
        if chosen:
            yield from _detail(f"What is said: {stream}", chosen)
    yield ""


def _streams(rows: Mapping[str, Row]) -> Iterable[str]:
    """Time to the safe command [ms], faults x streams."""
    yield ""
    yield "**From the stamp of the last good sample to the safe command [ms]**"
    yield ""
    yield "| fault | what happens | " + " | ".join(NAMES) + " |"
    yield "|---|---|" + "---|" * len(NAMES)
    for fault in FAULTS:
        cells = [_cell(rows.get(f"{stream}/{fault.name}")) for stream in NAMES]
        yield f"| {fault.name} | {fault.what} | " + " | ".join(cells) + " |"


def _cell(row: Row | None) -> str:
    if row is None:
        return MISSING
    if row["problems"]:
        return f"**failed**: {'; '.join(row['problems'])}"
    if row["group"] == "arrest":
        return "stays stiff"
    return "works on" if row["limit_ms"] is None else f"{row['safe_ms']:.0f} (limit {row['limit_ms']:.0f})"


def _detail(heading: str, rows: Iterable[Row]) -> Iterable[str]:
    yield ""
    yield f"**{heading}**"
    yield ""
    yield "| fault | safe after [ms] | reason said | back after [s] | largest step |"
    yield "|---|---|---|---|---|"
    for row in rows:
        back = MISSING if row["back_s"] is None else f"{row['back_s']:.1f}"
        reason = row["reason"].replace("|", "/") or MISSING
        note = f" ({row['note']})" if row["note"] else ""
        yield f"| {row['row']} | {_cell(row)}{note} | {reason} | {back} | {row['jump']:.2f} |"
