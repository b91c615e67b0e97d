"""`surefoot latency`: newest frame to command on the wire, as a table or as JSON."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from bridge.clock import NS
from bridge.latency.hops import HOPS, Spread, frame_to_command, hops, shares
from bridge.latency.system import POLL_S, LiveSystem
from bridge.launch.command import ControllerKind

TARGET_P99_MS: Final = 50.0
SETTLE_S: Final = 2.0  # the first steps load what the later ones have


def latency(
    seconds: Annotated[float, typer.Option(min=1, metavar="S", help="How long to measure [s].")] = 30.0,
    json_: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the numbers there too.")] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="Configuration; default: the defaults.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
    ] = None,
    controller: Annotated[ControllerKind | None, typer.Option(help="mpc, or log: record what is asked.")] = None,
) -> int:
    """Measure how long a camera frame takes to become a command on the wire, and where the time goes.

    Runs perception (on a generated walk, without the pose estimator), anticipation, controller and drive as
    processes on ports of their own. For every frame the first command that rests on it counts, as it
    arrives at an observer. Run it on an idle machine.

    Example: surefoot latency --seconds 30 --json runs/latency.json
    """
    console = Console(stderr=True)
    kind = None if controller is None else controller.value
    with LiveSystem(seconds + 60.0, config, set_ or [], kind) as system:
        with console.status("starting perception, anticipation, controller and drive"):
            system.start()
            system.until(_after(SETTLE_S), "settling")
        since_ns = system.commands[-1][0].stamp_ns
        _measure(system, console, since_ns, seconds)
        heard, load = system.heard_since(since_ns), os.getloadavg()[0]
    total, parts = frame_to_command(heard), hops(heard)
    _show(total, parts, load)
    if json_ is not None:
        _write(json_, _plain(total, parts, seconds, load))
    return 0


def _after(span_s: float) -> Any:
    end_s = time.monotonic() + span_s
    return lambda: time.monotonic() > end_s


def _measure(system: LiveSystem, console: Console, since_ns: int, seconds: float) -> None:
    columns = (TextColumn("measuring"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=seconds)

        def over() -> bool:
            passed_s = (system.commands[-1][0].stamp_ns - since_ns) / NS
            progress.update(task, completed=passed_s)
            return passed_s > seconds

        system.until(over, "measuring", seconds + 60.0 + POLL_S)


def _show(total: Spread, parts: dict[str, Spread], load: float) -> None:
    table = Table(title="newest frame to command on the wire [ms]", title_justify="left")
    for heading in ("hop", "p50", "p99", "max", "share"):
        table.add_column(heading, justify="left" if heading == "hop" else "right")
    share = shares(parts)
    for name, part in parts.items():
        table.add_row(HOPS[name], f"{part.p50:.2f}", f"{part.p99:.2f}", f"{part.max:.2f}", f"{share[name]:.0%}")
    table.add_section()
    table.add_row("frame -> command", f"{total.p50:.2f}", f"{total.p99:.2f}", f"{total.max:.2f}", "", style="bold")
    console = Console()
    console.print(table)
    verdict = "met" if total.p99 <= TARGET_P99_MS else "missed"
    console.print(f"{total.frames} frames, load {load:.1f}; target p99 <= {TARGET_P99_MS:g} ms: {verdict}")


def _plain(total: Spread, parts: dict[str, Spread], seconds: float, load: float) -> dict[str, Any]:
    return {
        "frame_to_command_ms": total._asdict(),
        "hops": {name: part._asdict() for name, part in parts.items()},
        "shares": {name: round(share, 4) for name, share in shares(parts).items()},
        "seconds": seconds,
        "machine": {"cores": os.cpu_count(), "load_1min": round(load, 2)},
    }


def _write(file: Path, result: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_name(file.name + ".tmp")
    beside.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    beside.replace(file)
