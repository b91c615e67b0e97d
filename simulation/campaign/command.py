"""`surefoot campaign`: scenarios by the hundred through the whole stack, in three arms."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from bridge.command_line.options import ConfigOption, JobsOption, JsonOption, SeedOption, SetOption
from bridge.command_line.output import STDOUT, note, progress, require_writable, result, write_json
from bridge.config.load import load_config
from simulation.campaign.arms import ARMS
from simulation.campaign.campaign import Plan, run_campaign
from simulation.campaign.report import PAGE, SUMMARY, number
from simulation.weights import for_simulated_people

SHOWN = (
    "falls", "falls_arrested", "non_falls", "needless_arrests", "needless_guards", "tip_overs", "pelvis_drop_p95_m",
    "peak_force_median_n", "lead_median_s", "foreseen_lead_median_s", "rms_force_median_n", "energy_median_j_m",
)  # fmt: skip


def campaign(
    scenarios: Annotated[int, typer.Option(min=1, help="Falls, and as many non-falls.")] = 300,
    non_falls: Annotated[int | None, typer.Option(min=0, help="Non-falls, if not as many as falls.")] = None,
    arms: Annotated[str, typer.Option(metavar="ARM,...", help="Which arms.")] = ",".join(ARMS),
    record: Annotated[
        str, typer.Option(metavar="ARM", show_default=False, help="Keep the trials of this arm as recordings.")
    ] = "",
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Folder of the results; a stopped campaign goes on there.")
    ] = Path("runs/campaign"),
    seed: SeedOption = 0,
    jobs: JobsOption = 1,
    cluster: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address of a Dask scheduler that does the work instead.")
    ] = "",
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Let hundreds of simulated people fall and not fall, without intervention, with a reactive one, with anticipation.

    Everything is simulated time: the same seed gives the same results on any machine, with any number of jobs. Stop it
    and start it again: what is done is kept. Results: summary.json, results.parquet and index.html in the folder.

    The networks are those that have seen simulated people; `--set anticipation.checkpoint=default` takes the others.

    Example: surefoot campaign --scenarios 12 --jobs 2 --seed 1 --out runs/campaign
    """
    plan = Plan(
        scenarios, scenarios if non_falls is None else non_falls, seed,
        for_simulated_people(load_config(config, set_ or [])), tuple(arm.strip() for arm in arms.split(",")), record,
    )  # fmt: skip
    if json is not None:
        require_writable(json)
    columns = (TextColumn("scenarios"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with progress(*columns, transient=False) as bar:
        task = bar.add_task("scenarios", total=None)
        summary = run_campaign(plan, out, jobs, cluster, lambda done, of: bar.update(task, completed=done, total=of))
    if json is not None:
        write_json(json, {"plan": plan.described(), **summary})
    if json != STDOUT:
        result(_table(summary))
    note(f"{out / PAGE}", f"{out / SUMMARY}")
    return 0


def _table(summary: dict[str, Any]) -> Table:
    table = Table(title=f"{summary['scenarios']} scenarios, {summary['rejected_draws']} draws rejected")
    table.add_column("")
    for arm in summary["arms"]:
        table.add_column(arm, justify="right")
    for name in SHOWN:
        table.add_row(name, *(number(numbers[name]) for numbers in summary["arms"].values()))
    return table
