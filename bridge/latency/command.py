"""`surefoot latency`: newest frame to command on the wire, as a table or as JSON."""

from __future__ import annotations

import os
import time
from typing import Annotated, Any, Final

import typer
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from bridge.clock import NS
from bridge.command_line.options import ConfigOption, ControllerOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, progress, require_writable, result, status, write_json
from bridge.latency.hops import HOPS, Spread, measured, shares
from bridge.latency.system import POLL_S, LiveSystem

TARGET_P99_MS: Final = 50.0
SETTLE_S: Final = 2.0  # the first steps load what the later ones have


def latency(
    duration: Annotated[float, typer.Option("--duration", min=1, metavar="S", help="How long to measure [s].")] = 30.0,
    controller: ControllerOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Measure how long a camera frame takes to become a command on the wire, and where the time goes.

    Runs perception (on a generated walk, without the pose estimator), anticipation, controller and drive as
    processes on ports of their own. For every frame the first command that rests on it counts, as it
    arrives at an observer. Run it on an idle machine.

    Example: surefoot latency --duration 30 --json runs/latency.json
    """
    if json is not None:
        require_writable(json)
    kind = None if controller is None else controller.value
    with LiveSystem(duration + 60.0, config, set_ or [], kind) as system:
        with status("starting perception, anticipation, controller and drive"):
            system.start()
            system.until(_after(SETTLE_S), "settling")
        since_ns = system.commands[-1][0].stamp_ns
        _measure(system, since_ns, duration)
        heard, load = system.heard_since(since_ns), os.getloadavg()[0]
    total, parts = measured(heard)
    if json is not None:
        write_json(json, _plain(total, parts, duration, load))
    if json != STDOUT:
        _show(total, parts, load)
    return 0


def _after(span_s: float) -> Any:
    end_s = time.monotonic() + span_s
    return lambda: time.monotonic() > end_s


def _measure(system: LiveSystem, since_ns: int, seconds: float) -> None:
    with progress(TextColumn("measuring"), BarColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("", total=seconds)

        def over() -> bool:
            passed_s = (system.commands[-1][0].stamp_ns - since_ns) / NS
            bar.update(task, completed=passed_s)
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
    verdict = "met" if total.p99 <= TARGET_P99_MS else "missed"
    result(table, f"{total.frames} frames, load {load:.1f}; target p99 <= {TARGET_P99_MS:g} ms: {verdict}")


def _plain(total: Spread, parts: dict[str, Spread], seconds: float, load: float) -> dict[str, Any]:
    return {
        "frame_to_command_ms": total._asdict(),
        "hops": {name: part._asdict() for name, part in parts.items()},
        "shares": {name: round(share, 4) for name, share in shares(parts).items()},
        "seconds": seconds,
        "machine": {"cores": os.cpu_count(), "load_1min": round(load, 2)},
    }
