"""Faults x streams and faults of processes, on real processes over the real wire.

python -m benchmarks.faults                              # everything: about six minutes
python -m benchmarks.faults --only stream=horizon        # the rows of one stream, merged into runs/faults.json
python -m benchmarks.faults --only fault=garbage --only stream=wrench
python -m benchmarks.faults --table                      # writes the table into docs/safety.md from what is there
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

from benchmarks.faults.judge import Outcome
from benchmarks.faults.process_rows import PROCESS_ROWS, arresting, hanging_system
from benchmarks.faults.results import RESULTS, merge, read, write_table
from benchmarks.faults.stream_faults import FAULTS, StreamFault
from benchmarks.faults.stream_rows import NAMES, run_stream_row
from benchmarks.faults.system import DirectSystem, RelayedSystem, System


def stream_rows(wanted: Callable[[str, str], bool]) -> Iterator[Outcome]:
    """Run the wanted rows of faults x streams on one running system."""
    rows: list[tuple[str, StreamFault]] = [(s, f) for s in NAMES for f in FAULTS if wanted(s, f.name)]
    if not rows:
        return
    with RelayedSystem() as system:
        system.start()
        for stream, fault in rows:
            yield _whole(system, run_stream_row(system, stream, fault))


def _whole(system: System, outcome: Outcome) -> Outcome:
    """Return the row with what nodes published that nobody can read."""
    spoilt, system.spoilt = system.spoilt, []
    return replace(outcome, problems=(*outcome.problems, *spoilt))


def process_rows(wanted: Callable[[str, str], bool]) -> Iterator[Outcome]:
    """Run the wanted rows of killed, frozen and doubled processes."""
    walking = [row for row in PROCESS_ROWS if row.group != "arrest" and wanted(row.group, row.row)]
    hanging = [row for row in PROCESS_ROWS if row.group == "arrest" and wanted(row.group, row.row)]
    if walking:
        with DirectSystem() as system:
            system.start()
            yield from (_whole(system, row.run(system)) for row in walking)
    if hanging:
        with hanging_system() as system:
            system.start(lambda: arresting(system))
            yield from (_whole(system, row.run(system)) for row in hanging)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--only", action="append", default=[], metavar="stream=S|fault=F", help="rows of a stream or group; repeatable"
    )
    parser.add_argument("--json", type=Path, default=RESULTS, help="where the rows are kept")
    parser.add_argument("--table", action="store_true", help="run nothing, write docs/safety.md from the rows")
    parser.add_argument("--list", action="store_true", help="run nothing, name the rows")
    arguments = parser.parse_args()
    wanted = _filter(arguments.only)
    if arguments.list:
        names = [(s, f.name) for s in NAMES for f in FAULTS] + [(row.group, row.row) for row in PROCESS_ROWS]
        print(*(f"stream={group} fault={row}" for group, row in names if wanted(group, row)), sep="\n")
        return 0
    failed = 0
    if not arguments.table:
        for outcome in chain(stream_rows(wanted), process_rows(wanted)):
            merge(arguments.json, outcome)
            failed += not outcome.ok
            print(line(outcome), flush=True)
    if arguments.table or not arguments.only:
        write_table(read(arguments.json))
    return 1 if failed else 0


def line(outcome: Outcome) -> str:
    """Return one row as text."""
    safe = (
        "works on" if outcome.limit_ms is None else f"{outcome.safe_ms or float('nan'):6.0f}/{outcome.limit_ms:.0f} ms"
    )
    back = "" if outcome.back_s is None else f"back {outcome.back_s:.2f} s"
    return (
        f"{'ok  ' if outcome.ok else 'FAIL'} {outcome.group:12s} {outcome.row:24s} {safe:>14s} jump {outcome.jump:.2f} "
        f"{back:12s} {outcome.reason}" + "".join(f"\n     ! {problem}" for problem in outcome.problems)
    )


def _filter(only: list[str]) -> Callable[[str, str], bool]:
    chosen: dict[str, set[str]] = {}
    for text in only:
        name, equals, value = text.partition("=")
        if not equals or name not in {"stream", "fault"}:
            sys.exit(f"--only {text}: expected stream=NAME or fault=NAME")
        chosen.setdefault(name, set()).add(value)
    streams, faults = chosen.get("stream"), chosen.get("fault")
    return lambda stream, fault: (streams is None or stream in streams) and (faults is None or fault in faults)


if __name__ == "__main__":
    raise SystemExit(main())
