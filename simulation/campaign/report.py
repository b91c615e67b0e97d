"""What a campaign leaves behind: summary.json, results.parquet and a page with pictures."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from bridge.errors import MissingExtraError
from simulation.campaign.pictures import draw_all
from simulation.campaign.store import write
from simulation.campaign.summary import summarise

SUMMARY: Final = "summary.json"
TABLE: Final = "results.parquet"
PAGE: Final = "index.html"


def parquet() -> Any:
    """Return the library that writes the table.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise MissingExtraError("the table of results", "pyarrow", "campaign") from error


def rows(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one flat row for each trial."""
    table = []
    for result in results:
        scenario = dict(result["scenario"])
        for axis, force in zip(("forward", "left", "up"), scenario.pop("force_offset_n"), strict=True):
            scenario[f"force_offset_{axis}_n"] = force
        for arm, trial in result["trials"].items():
            failed = ", ".join(trial["failed_checks"])
            table.append({"name": result["name"], "arm": arm, **scenario, **trial["measures"], "failed_checks": failed})
    return table


def report(folder: Path, plan: Mapping[str, Any], results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Write summary, table and page into `folder`; return the summary."""
    arms = plan["arms"]
    summary = summarise(results, arms)
    write(folder / SUMMARY, {"plan": plan, **summary})
    arrow = importlib.import_module("pyarrow")
    partial = folder / f".{TABLE}.partial"
    parquet().write_table(arrow.Table.from_pylist(rows(results)), partial)
    partial.replace(folder / TABLE)
    judged = "anticipatory" if "anticipatory" in arms else arms[-1]
    shown = [{**r, "m": r["trials"][judged]["measures"]} for r in results]
    environment = Environment(
        loader=PackageLoader("simulation.campaign", "."), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["number"] = number
    text = environment.get_template("page.html").render(
        plan=plan, summary=summary, pictures=draw_all(results, arms, folder),
        names=[name for name in summary["arms"][judged] if not name.endswith("_ci95")],
        missed=[r for r in shown if r["scenario"]["kind"] == "fall" and not r["m"]["arrested_fall"]],
        needless=[r for r in shown if r["scenario"]["kind"] == "non_fall" and r["m"]["arrests"]],
    )  # fmt: skip
    partial = folder / f".{PAGE}.partial"
    partial.write_text(text, encoding="utf-8")
    partial.replace(folder / PAGE)
    return summary


def number(value: Any) -> str:
    """Return a number as a table shows it; a dash for none."""
    if value is None or value != value:  # noqa: PLR0124 (NaN)
        return "–"
    return f"{value:.3g}" if isinstance(value, float) and abs(value) < 100 else f"{value:.0f}"
