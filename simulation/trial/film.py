"""A film and a strip of pictures of two trials side by side, rendered off screen.

Run as a process of its own (`python -m simulation.trial.film ...`): MuJoCo chooses its OpenGL when it is first
imported, and a missing one must not take anything else down.
"""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")  # software rendering works without a screen; your own setting wins

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from bridge.colours import FALL, INK, STABLE
from bridge.config.load import load_config
from simulation.scenarios.scenario import Performance
from simulation.scenarios.single import scenario_from
from simulation.trial.trace import Trace, load_trace

SIDE_PX: Final = 300
FRAMES_A_SECOND: Final = 10
STRIP: Final = (-0.6, 0.3, 0.7, 1.1, 1.6, 2.6)  # seconds after the event
NO_PICTURES: Final = 3  # exit code: rendering is impossible here

Pixels = NDArray[np.uint8]


class Stage:
    """The model of a trial, seen from the side."""

    def __init__(self, model: Any) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._renderer = mujoco.Renderer(model, SIDE_PX, SIDE_PX)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self._camera.distance, self._camera.azimuth, self._camera.elevation = 3.0, 125.0, -8.0

    def picture(self, trace: Trace, time_s: float) -> Pixels:
        """Return the moment as (SIDE_PX, SIDE_PX, 3) RGB."""
        row = int(np.clip(np.searchsorted(trace.time_s, time_s), 0, len(trace.time_s) - 1))
        self._data.qpos[:] = trace.qpos[row]
        mujoco.mj_forward(self._model, self._data)
        x, y, _ = trace.pelvis_m[row]
        self._camera.lookat[:] = (x, y, 0.80)
        self._renderer.update_scene(self._data, self._camera)
        image: Pixels = self._renderer.render()
        return image

    def close(self) -> None:
        """Release OpenGL."""
        self._renderer.close()


def titled(image: Pixels, title: str, colour: str) -> Image.Image:
    """Return the picture with a line of text on it."""
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, 0, SIDE_PX, 22), fill="white")
    draw.text((8, 4), title, fill=colour, font_size=13)
    return picture


def pair(left: Image.Image, right: Image.Image) -> Image.Image:
    """Return two pictures side by side with a gap."""
    both = Image.new("RGB", (2 * SIDE_PX + 6, SIDE_PX), "white")
    both.paste(left, (0, 0))
    both.paste(right, (SIDE_PX + 6, 0))
    return both


def film(stage: Stage, held: Trace, unheld: Trace, event_s: float, out: Path) -> None:
    """Write an animated GIF from 2 s before the event to 4.5 s after it."""
    frames = []
    for time_s in np.arange(event_s - 2.0, event_s + 4.5, 1.0 / FRAMES_A_SECOND):
        since = f"{time_s - event_s:+.1f} s"
        left = titled(stage.picture(held, time_s), f"with Surefoot   {since}", STABLE)
        right = titled(stage.picture(unheld, time_s), f"without   {since}", FALL)
        frames.append(pair(left, right).quantize(colors=64, method=Image.Quantize.MEDIANCUT))
    _save(frames[0], out, save_all=True, append_images=frames[1:], duration=1000 // FRAMES_A_SECOND, loop=0)


def strip(stage: Stage, held: Trace, unheld: Trace, event_s: float, out: Path) -> None:
    """Write a PNG with six moments of each trial."""
    sheet = Image.new("RGB", (len(STRIP) * SIDE_PX, 2 * SIDE_PX), "white")
    for row, (trace, name, colour) in enumerate(((held, "with Surefoot", STABLE), (unheld, "without", FALL))):
        for column, after in enumerate(STRIP):
            moment = f"{after:+.1f} s" + (f"  {name}" if column == 0 else "")
            picture = titled(stage.picture(trace, event_s + after), moment, colour if column == 0 else INK)
            sheet.paste(picture, (column * SIDE_PX, row * SIDE_PX))
    _save(sheet.quantize(colors=128), out)


def _save(image: Image.Image, out: Path, **options: Any) -> None:
    part = out.with_name(out.name + ".part")
    image.save(part, format=out.suffix.removeprefix("."), **options)
    part.replace(out)


def main(arguments: Sequence[str] | None = None) -> int:
    """Render two traces; exit code 3 and one line where there is nothing to render with."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("held", type=Path)
    parser.add_argument("unheld", type=Path)
    parser.add_argument("out", type=Path, help="folder for demo.gif and demo.png")
    parser.add_argument("--event-s", type=float, required=True)
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("--config", type=Path)
    given = parser.parse_args(arguments)
    config = load_config(given.config, given.set).simulation
    model = Performance(scenario_from(config), slack_m=config.harness_slack_m).world.model
    try:
        stage = Stage(model)
    except Exception as error:  # noqa: BLE001 (every OpenGL binding fails in its own way)
        print(f"no film: OpenGL cannot be used here ({str(error).splitlines()[0]})", file=sys.stderr)  # noqa: T201
        return NO_PICTURES
    held, unheld = load_trace(given.held), load_trace(given.unheld)
    film(stage, held, unheld, given.event_s, given.out / "demo.gif")
    strip(stage, held, unheld, given.event_s, given.out / "demo.png")
    stage.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
