"""`surefoot rehearse`: the real processes on the recording that ships, with a timeline and a picture of it."""

from __future__ import annotations

import importlib
import os
import socket
from collections.abc import Sequence
from contextlib import closing
from importlib import resources
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from rich.console import Console

from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError, SurefootError, TransportError
from bridge.launch.command import ControllerKind
from bridge.launch.observed import observe
from bridge.launch.picture import Labels, Picture, write
from bridge.launch.ports import require_free
from bridge.launch.summary import Summary, fall_of, sentences, summarise
from bridge.launch.timeline import Recorder, Row, to_csv

CLIP: Final = "walk-stumble-fall"
ROLES: Final = ("perception", "anticipation", "controller", "drive")
TABLE_PERIOD_S: Final = 0.02  # of the columns in file and picture
TIME_LIMIT_S: Final = 55.0  # it never takes longer, whatever happens


def rehearse(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where timeline.png and timeline.csv go.")] = Path(
        "runs/rehearse"
    ),
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="Configuration; default: the defaults.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a value; repeatable.")
    ] = None,
    controller: Annotated[ControllerKind | None, typer.Option(help="mpc, or log: record what is asked.")] = None,
    seconds: Annotated[float | None, typer.Option(min=1, metavar="S", help="Stop after this long [s].")] = None,
) -> int:
    """Run perception, anticipation, controller and drive on a generated walk, stumble and fall.

    Prints a line every half second and at each change of state, then a summary; writes
    timeline.png and timeline.csv. Ends by itself. Exit code 2: a process refused to start or died.
    """
    recording = _recording()
    overrides = [*(set_ or []), *private_wire(config, set_ or [])]
    loaded = load_config(config, overrides)
    options: dict[str, dict[str, str]] = {"perception": {"source": f"{recording}:{CLIP}"}}
    if controller is not None:
        options["controller"] = {"controller": controller.value}
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"[bold]surefoot rehearse[/]  {CLIP}: a generated recording, through the real processes over Zenoh")
    recorder = observe(config, overrides, options, out / "logs", console, limit_s=TIME_LIMIT_S, seconds=seconds)
    rows = recorder.rows(TABLE_PERIOD_S)
    if not rows:
        raise SurefootError(f"rehearse: ended before any keypoints came; see {out / 'logs'}")
    labels = _labels(recording)
    summary = summarise(rows, *(fall_of(labels.label, labels.time_s)))
    _write(out, loaded, recorder, rows, labels, summary)
    console.print()
    for sentence in sentences(summary, recorder.latency_s):
        console.print(sentence)
    console.print(f"[bold]{out / 'timeline.png'}[/]  and the same numbers in {out / 'timeline.csv'}")
    return 0


def _recording() -> Path:
    """Return the keypoint file that ships.

    Raises:
        SourceError: the installation lacks it.
    """
    file = Path(str(resources.files("simulation"))) / "demo" / f"{CLIP}.npz"
    if not file.is_file():
        raise SourceError(f"{file}: the demo's recording is missing from this installation")
    return file


def _labels(recording: Path) -> Labels:
    with np.load(recording) as arrays:
        label = arrays[f"{CLIP}/label"]
        fps = float(arrays[f"{CLIP}/fps"])
    return Labels(np.arange(len(label)) / fps, label)


def private_wire(config: Path | None, overrides: Sequence[str]) -> list[str]:
    """Return overrides that keep a run off a wire in use: its own namespace, and free ports where some are taken."""
    endpoints = load_config(config, overrides).bridge.endpoints
    private = [f'bridge.namespace="demo-{os.getpid()}"', "launch.restart=false", f"launch.roles={list(ROLES)}"]
    for role in ROLES:
        try:
            require_free(endpoints, [role])
        except TransportError:
            private.append(f"bridge.endpoints.{role}=tcp/127.0.0.1:{_free_port()}")
    return private


def _free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


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
