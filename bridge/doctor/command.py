"""`surefoot doctor`: what is wrong here, and the command that mends it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.text import Text

from bridge.command_line.options import ConfigOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, require_writable, result, status, write_json
from bridge.doctor.configuration import loaded
from bridge.doctor.examine import CHECKS, examine
from bridge.doctor.finding import Finding, Level, Patient
from bridge.errors import SurefootError
from bridge.exit_codes import ExitCode

STYLES: Final = {Level.GOOD: "green", Level.NOTE: "dim", Level.WARNING: "yellow", Level.BROKEN: "bold red"}


def _offered(incomplete: str) -> list[str]:
    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in CHECKS]


def doctor(
    only: Annotated[
        str | None,
        typer.Option(
            metavar="CHECK,...", autocompletion=_offered, show_default=False, help=f"Of {', '.join(CHECKS)}; all."
        ),
    ] = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Look at this machine and a configuration: what is there, what is wrong, and the command that mends it.

    Nothing is changed, nothing is downloaded; it may run beside a running system. Exit code 0: everything that the
    configuration asks for works, there may be warnings. Exit code 1: something does not.

    Example: surefoot doctor --config my.toml
    """
    names = _chosen(only)
    if json is not None:
        require_writable(json)
    with _quiet():
        findings = _examined(config, tuple(set_ or []), names)
    counts = {level.value: sum(finding.level is level for finding in findings) for level in Level}
    if json is not None:
        write_json(json, {"well": not counts["broken"], "counts": counts, "findings": findings})
    if json != STDOUT:
        for finding in findings:
            result(*_lines(finding))
        result(_sum(counts))
    return ExitCode.CHECK_FAILED if counts["broken"] else ExitCode.DONE


def _examined(config: Path | None, overrides: tuple[str, ...], names: list[str]) -> list[Finding]:
    patient = Patient(config, overrides, loaded(config, overrides))
    findings: list[Finding] = []
    with status("looking") as spinner:
        for name in names:
            spinner.update(f"looking: {name}")
            findings += examine(patient, CHECKS, [name])
    return findings


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what the checks say themselves from being said a second time by logs."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)


def _chosen(only: str | None) -> list[str]:
    if only is None:
        return list(CHECKS)
    names = [name.strip() for name in only.split(",")]
    for name in names:
        if name not in CHECKS:
            raise SurefootError(f"--only {name}: no such check; known: {', '.join(CHECKS)}")
    return names


def _lines(finding: Finding) -> list[Text]:
    style = STYLES[finding.level]
    lines = [Text.assemble((f"{finding.level:<8}", style), f" {finding.check:<13} {finding.text}")]
    if finding.mend:
        lines.append(Text(f"{'':<22} -> {finding.mend}", style="" if finding.level is not Level.NOTE else "dim"))
    return lines


def _sum(counts: dict[str, int]) -> Text:
    if counts["broken"]:
        return Text(f"{counts['broken']} broken, {counts['warning']} warnings", style=STYLES[Level.BROKEN])
    if counts["warning"]:
        return Text(f"everything works, {counts['warning']} warnings", style=STYLES[Level.WARNING])
    return Text("everything works", style=STYLES[Level.GOOD])
