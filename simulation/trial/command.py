"""`surefoot demo`: a person walks, is pushed, and is held; then the same push without help."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from bridge.clock import NS
from bridge.command_line.options import ConfigOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, note, note_console, require_writable, result, status, write_json
from bridge.config.load import load_config
from bridge.errors import SurefootError
from bridge.launch.observed import observe
from bridge.launch.private import private_wire
from bridge.launch.rehearse import ROLES
from bridge.launch.timeline import Row
from simulation.scenarios.arrest import ALLOWED_DROP_M
from simulation.scenarios.single import AFTER_EVENT_S
from simulation.trial.figure import Told, draw
from simulation.trial.outcome import Outcome, outcome_of
from simulation.trial.trace import Trace, load_trace

WORLD: Final = (
    f"launch.roles={list(ROLES)}",
    "launch.restart=false",
    'launch.modules.drive="simulation.node"',
    'simulation.begins="armed"',
)
START_LIMIT_S: Final = 30.0  # no trial takes longer than its scenario and this, whatever happens
FILM_LIMIT_S: Final = 120.0
RECORDER_STOP_S: Final = 20.0
WITHOUT_HELP: Final = ("intervention.steps_used=0",)


class Trial(NamedTuple):
    """One run of the four processes."""

    trace: Trace
    rows: list[Row]
    event_s: float  # when it happened, in the rows' time [s]
    outcome: Outcome
    reason: str  # of the first ARREST
    arrest_s: float  # from what happened to it; negative: needlessly before; NaN: none


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Where film, pictures and recordings go.")
    ] = Path("runs/demo"),
    film: Annotated[bool, typer.Option(help="Render demo.gif and demo.png.")] = True,
    clip: Annotated[
        str, typer.Option(metavar="FILE.npz:NAME", help="Motion capture that drives the person until the push.")
    ] = "",
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Run the real processes with a simulated person, twice: with Surefoot, and with its intervention switched off.

    Perception, anticipation, controller and a MuJoCo world talk over Zenoh in real time. Writes demo.gif and demo.png
    (rendered off screen), timeline.png, an MCAP recording and a trace of each trial, and prints both outcomes.

    Example: surefoot demo --set simulation.scenario=trip --set simulation.person_mass_kg=100
    """
    if json is not None:
        require_writable(json)
    console = note_console()
    chosen = [f"simulation.clip={clip}"] if clip else []
    overrides = [*(set_ or []), *chosen, *private_wire(config, set_ or [], ROLES, "demo"), *WORLD]
    settings = load_config(config, overrides).simulation
    console.print(
        f"[bold]surefoot demo[/]  {settings.person_height_m:.2f} m, {settings.person_mass_kg:.0f} kg, walking at"
        f" {settings.walking_speed_m_s:.1f} m/s; {settings.scenario} at {settings.event_s:.0f} s;"
        " four processes over Zenoh, in real time"
    )
    out.mkdir(parents=True, exist_ok=True)
    console.print("\n[bold]1. with Surefoot[/]")
    held = _run("held", out, config, overrides, settings.event_s, console)
    console.print("\n[bold]2. the same without intervention[/]")
    unheld = _run("unheld", out, config, [*overrides, *WITHOUT_HELP], settings.event_s, console)
    told = [
        Told(name, trial.trace, settings.event_s, trial.rows, trial.event_s)
        for name, trial in (("with Surefoot", held), ("without intervention", unheld))
    ]
    draw(told, out / "timeline.png")
    made = ["timeline.png", *(name for name in ("held.mcap", "unheld.mcap") if (out / name).is_file())]
    with status("rendering the film"):
        filmed = film and _film(out, config, overrides, settings.event_s, console)
    if filmed:
        made = ["demo.gif", "demo.png", *made]
    if json is not None:
        write_json(json, {"held": _plain(held), "unheld": _plain(unheld), "folder": out, "files": made})
    if json != STDOUT:
        result(_side_by_side(held, unheld))
    note(f"in {out}: {', '.join(made)}")
    return 0


def _plain(trial: Trial) -> dict[str, Any]:
    return {
        **trial.outcome._asdict(), "held": trial.outcome.held, "reason": trial.reason, "arrest_s": trial.arrest_s,
    }  # fmt: skip


def _when(arrest_s: float) -> str:
    if np.isnan(arrest_s):
        return "-"
    return f"{arrest_s:+.2f}" + (": needlessly before" if arrest_s < 0 else "")


def _run(
    name: str, out: Path, config: Path | None, overrides: Sequence[str], event_s: float, console: Console
) -> Trial:
    """Run one trial and return what became of it."""
    trace, recording = out / f"{name}.npz", out / f"{name}.mcap"
    for old in (trace, recording):
        old.unlink(missing_ok=True)
    limit_s = event_s + AFTER_EVENT_S + START_LIMIT_S
    options = {"perception": {"source": "wire"}, "drive": {"trace": str(trace)}}
    with _recording(recording, config, overrides):
        recorder = observe(config, overrides, options, out / "logs" / name, console, until="drive", limit_s=limit_s)
    rows = recorder.rows(0.02)
    if not recording.is_file():
        console.print(f"no recording: {recording} could not be written")
    if not rows or not trace.is_file():
        raise SurefootError(f"demo: the trial ended before anything happened; see {out / 'logs' / name}")
    told = load_trace(trace)
    if told.time_s[-1] <= event_s:
        raise SurefootError(f"demo: the trial ended before {event_s:g} s; see {out / 'logs' / name}")
    happened_ns = float(np.interp(event_s, told.time_s, told.stamp_ns))
    happened_s = (happened_ns - (recorder.origin_ns or 0)) / NS
    arrest = next((row for row in rows if row.state == "ARREST"), None)
    reason, arrest_s = ("", float("nan")) if arrest is None else (arrest.reason, arrest.time_s - happened_s)
    return Trial(told, rows, happened_s, outcome_of(told, event_s), reason, arrest_s)


@contextmanager
def _recording(path: Path, config: Path | None, overrides: Sequence[str]) -> Iterator[None]:
    """Record the wire into `path` meanwhile, in a process of its own."""
    words = ["record", "--out", str(path), "--force"]
    words += ["--config", str(config)] if config is not None else []
    words += [word for override in overrides for word in ("--set", override)]
    process = subprocess.Popen(  # noqa: S603 (our own command)
        [sys.executable, "-m", "bridge.cli", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(timeout=RECORDER_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()  # what it has written is readable up to the last second
            process.wait()


def _film(out: Path, config: Path | None, overrides: Sequence[str], event_s: float, console: Console) -> bool:
    """Render the film in a process of its own; return whether there is one now."""
    words = [str(out / "held.npz"), str(out / "unheld.npz"), str(out), "--event-s", str(event_s)]
    words += ["--config", str(config)] if config is not None else []
    words += [word for override in overrides for word in ("--set", override)]
    try:
        done = subprocess.run(  # noqa: S603 (our own module)
            [sys.executable, "-m", "simulation.trial.film", *words],
            capture_output=True, text=True, timeout=FILM_LIMIT_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        console.print(f"no film: rendering took longer than {FILM_LIMIT_S:.0f} s")
        return False
    if done.returncode != 0:
        console.print((done.stderr.strip().splitlines() or ["no film: rendering failed"])[-1])
        return False
    return True


def _side_by_side(held: Trial, unheld: Trial) -> Table:
    table = Table("", "with Surefoot", "without")
    lines: tuple[tuple[str, Callable[[Outcome], str]], ...] = (
        ("outcome", lambda o: "held" if o.held else "fell"),
        (f"pelvis drop in m, limit {ALLOWED_DROP_M:.2f}", lambda o: f"{o.drop_m:.2f}"),
        ("peak force at the harness in N", lambda o: f"{o.peak_force_n:.0f}"),
        ("knees or trunk on the floor", lambda o: "yes" if o.touched else "no"),
        ("walker tipped", lambda o: "yes" if o.tipped else "no"),
    )
    for name, of in lines:
        table.add_row(name, of(held.outcome), of(unheld.outcome))
    table.add_row("arrested, s after it happened", *(_when(trial.arrest_s) for trial in (held, unheld)))
    table.add_row("why it arrested", held.reason or "-", unheld.reason or "-")
    return table
