"""`surefoot rehearse`: the real processes on the recording that ships, with a timeline and a picture of it."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from bridge.command_line.options import ConfigOption, ControllerOption, DurationOption, JsonOption, SetOption
from bridge.command_line.output import STDOUT, note, note_console, require_writable, result, write_json
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from bridge.latency.hops import spread
from bridge.launch.clip import CLIP, shipped_recording
from bridge.launch.observed import observe
from bridge.launch.picture import Labels, Picture, write
from bridge.launch.private import private_wire
from bridge.launch.summary import Summary, fall_of, sentences, summarise
from bridge.launch.timeline import Recorder, Row, to_csv

ROLES: Final = ("perception", "anticipation", "controller", "drive")
TABLE_PERIOD_S: Final = 0.02  # of the columns in file and picture
TIME_LIMIT_S: Final = 55.0  # it never takes longer, whatever happens


def rehearse(
    out: Annotated[
        Path, typer.Option("--out", metavar="FOLDER", help="Where timeline.png and timeline.csv go.")
    ] = Path("runs/rehearse"),
    controller: ControllerOption = None,
    duration: DurationOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Run perception, anticipation, controller and drive on a generated walk, stumble and fall.

    Says on stderr how things are every half second and at each change of state, prints a summary, and writes
    timeline.png and timeline.csv. Ends by itself. Exit code 2: a process refused to start or died.

    Example: surefoot rehearse --controller log --out runs/rehearse
    """
    if json is not None:
        require_writable(json)
    recording = shipped_recording()
    overrides = [
        *(set_ or []),
        *private_wire(config, set_ or [], ROLES, "rehearsal"),
        "launch.restart=false",
        f"launch.roles={list(ROLES)}",
    ]
    loaded = load_config(config, overrides)
    options: dict[str, dict[str, str]] = {"perception": {"source": f"{recording}:{CLIP}"}}
    if controller is not None:
        options["controller"] = {"controller": controller.value}
    console = note_console()
    console.print(f"[bold]surefoot rehearse[/]  {CLIP}: a generated recording, through the real processes over Zenoh")
    recorder = observe(config, overrides, options, out / "logs", console, limit_s=TIME_LIMIT_S, seconds=duration)
    rows = recorder.rows(TABLE_PERIOD_S)
    if not rows:
        raise SurefootError(f"rehearse: ended before any keypoints came; see {out / 'logs'}")
    labels = _labels(recording)
    summary = summarise(rows, *(fall_of(labels.label, labels.time_s)))
    _write(out, loaded, recorder, rows, labels, summary)
    if json is not None:
        spans_ms = spread(span * 1e3 for span in recorder.latency_s)
        write_json(json, {**summary._asdict(), "frame_to_command_ms": spans_ms})
    if json != STDOUT:
        result(*sentences(summary, recorder.latency_s))
    note(f"{out / 'timeline.png'}  and the same numbers in {out / 'timeline.csv'}")
    return 0


def _labels(recording: Path) -> Labels:
    with np.load(recording) as arrays:
        label = arrays[f"{CLIP}/label"]
        fps = float(arrays[f"{CLIP}/fps"])
    return Labels(np.arange(len(label)) / fps, label)


def _write(
    out: Path, config: SurefootConfig, recorder: Recorder, rows: list[Row], labels: Labels, summary: Summary
) -> None:
    out.mkdir(parents=True, exist_ok=True)
    part = out / "timeline.csv.part"
    part.write_text(to_csv(rows))
    part.replace(out / "timeline.csv")
    links = importlib.import_module("perception.skeleton").LINKS
    title = "A generated walk, stumble and fall, through perception, anticipation and controller"
    snapshots = [recorder.snapshot(time_s) for time_s in _moments(rows, summary)]
    write(Picture(title, rows, snapshots, labels, config.intervention, links), out / "timeline.png")


def _moments(rows: Sequence[Row], summary: Summary) -> list[float]:
    """Return when to show the skeleton: walking, nearest to the boundary before the fall, and falling."""
    end_s = rows[-1].time_s
    if summary.onset_s is None:
        return [end_s * share for share in np.linspace(0.05, 0.95, 8)]
    onset_s, down_s = summary.onset_s, summary.lying_s or end_s
    walking = [row for row in rows if 2.5 < row.time_s < onset_s - 0.5 and not np.isnan(row.distance_ahead)]
    nearest_s = min(walking, key=lambda row: row.distance_ahead).time_s if walking else 0.5 * onset_s
    falling = np.linspace(onset_s, down_s, 5).tolist()
    return [time_s for time_s in sorted({2.0, nearest_s, *falling, min(down_s + 1.0, end_s)}) if time_s <= end_s]
