"""`surefoot view`: what is shown, and where."""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.progress import BarColumn, TimeRemainingColumn

from bridge.clock import SystemClock
from bridge.command_line.options import ConfigOption, CropOption, DurationOption, ForceOption, SetOption
from bridge.command_line.output import note, progress
from bridge.config.load import load_config
from bridge.config.perception import SourceConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SourceError
from bridge.launch.watch import StopSignals
from bridge.record.reader import Recording
from bridge.transport.zenoh import ZenohTransport
from bridge.view import viewer
from bridge.view.extra import load_rerun
from bridge.view.rrd import RrdFile
from bridge.view.studio import Studio, Subject, require_messages
from bridge.view.video import Still, Video

WEB_PORT: Final = 9090
NICENESS: Final = 10  # what is watched goes first
WAIT_S: Final = 0.1


def view(
    recording: Annotated[
        Path | None, typer.Argument(metavar="[RECORDING]", help="An .mcap file or rosbag2 folder; none: what runs now.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.rrd", help="Write a file for Rerun instead of opening a window."),
    ] = None,
    force: ForceOption = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="Show it in a browser instead of a window; on this machine only.")
    ] = False,
    port: Annotated[
        int, typer.Option(min=1024, max=65534, help="Of the page; its data are at the next port.")
    ] = WEB_PORT,
    window: Annotated[
        bool | None, typer.Option("--window/--no-window", help="Default: a window unless --out or --serve is given.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Video or image folder that perception saw, laid underneath.")
    ] = None,
    crop: CropOption = None,
    video_offset: Annotated[float, typer.Option(metavar="S", help="Show the video this much later [s].")] = 0.0,
    duration: DurationOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
) -> int:
    """Look at what runs now, or at a recording, in Rerun: person, plane, horizon, control, health.

    Only listens: whatever happens to it, the running control notices nothing. Ends with Ctrl-C,
    SIGTERM, its window, or --duration. Exit code 2: bad input, no display, a file that cannot be written.

    Example: surefoot view walk.mcap --out walk.rrd --video walk.mp4

    Beside `surefoot up`: surefoot view
    """
    loaded = load_config(config, set_ or [])
    rerun = load_rerun()
    found = None if recording is None else Recording(recording)
    if found is not None:
        require_messages(found)
    subject = Subject(
        loaded,
        importlib.import_module("anticipation.plane_file").read_plane(loaded.anticipation.checkpoint),
        importlib.import_module("perception.skeleton").LINKS,
        _video(video, crop, loaded.perception.source, video_offset, live=found is None),
    )
    with ExitStack() as stack:
        stop = stack.enter_context(StopSignals())
        file = None if out is None else stack.enter_context(RrdFile(out, overwrite=force))
        viewers = []
        if serve:
            viewers.append(stack.enter_context(viewer.web(rerun.viewer, port)))
            note(f"open {viewer.page(port)}")
        if window if window is not None else not serve and out is None:
            viewers.append(stack.enter_context(viewer.window(rerun.viewer)))
        if not viewers and file is None:
            raise ConfigError("--no-window leaves nothing to show on: add --out FILE.rrd or --serve")
        studio = Studio(rerun, subject, viewers, file)
        until_s = None if duration is None else time.monotonic() + duration

        def ended() -> bool:
            over = until_s is not None and time.monotonic() >= until_s
            return over or stop.seen is not None or not studio.watched

        if found is None:
            _live(studio, loaded, ended)
            studio.finish()
        else:
            _draw(studio, found, ended)
            studio.finish()
            if found.damage:
                note(f"{found.path}: not whole: {found.damage}")
            while viewers and not ended():
                time.sleep(WAIT_S)
        for one in viewers:
            one.require_well()
    if out is not None:
        note(f"{out}: {out.stat().st_size / 1e6:.2f} MB")
    return 0


def _draw(studio: Studio, recording: Recording, ended: Callable[[], bool]) -> None:
    with progress("drawing", BarColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("drawing", total=1.0)

        def looked() -> bool:
            bar.update(task, completed=recording.progress)
            return ended()

        studio.show_recording(recording, looked)


def _live(studio: Studio, config: SurefootConfig, ended: Callable[[], bool]) -> None:
    os.nice(NICENESS)
    note("listening only; Ctrl-C ends it")
    clock = SystemClock()
    with closing(ZenohTransport(config.bridge, "viewer", clock)) as transport:
        lost = studio.show_live(transport, clock, ended)
    if lost:
        note(f"{lost} messages came faster than they could be drawn and are not shown")


def _video(video: Path | None, crop: str | None, source: SourceConfig, offset_s: float, *, live: bool) -> Video | None:
    """Return the pictures to lay under the keypoints: those asked for, or, live, those the config's source plays."""
    path = video
    if path is None and live and source.uri and not source.uri.endswith(".npz") and Path(source.uri).exists():
        path = Path(source.uri)
    if path is None:
        if crop is not None:
            raise ConfigError("--crop is for the video, and there is none: --video FILE")
        return None
    if not path.exists():
        raise SourceError(f"{path}: no such video file")
    used: Any = tuple(source.crop_px) or None
    if crop is not None:
        used = importlib.import_module("perception.sources.picture").parse_crop(crop)
    return Video(str(path), partial(_stills, path, used, source.fps_hz), offset_s)


def _stills(path: Path, crop: Any, fps_hz: float) -> Iterator[Still]:
    module, function = ("image_folder", "open_folder") if path.is_dir() else ("video_file", "open_video")
    stills: Iterator[Still] = getattr(importlib.import_module(f"perception.sources.{module}"), function)(
        path, crop, fps_hz
    )
    return stills
