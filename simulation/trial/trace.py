"""What happened in a simulated world, moment by moment, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from bridge.errors import SourceError
from bridge.messages import Floats
from simulation.scenarios.scenario import Performance

RATE_HZ: Final = 50.0


class Trace(NamedTuple):
    """Columns over time; T moments."""

    time_s: Floats  # (T,) of the scenario
    stamp_ns: Floats  # (T,) by the process' clock [ns]
    qpos: Floats  # (T, nq) of the MuJoCo model
    pelvis_m: Floats  # (T, 3) [m]
    pelvis_velocity_m_s: Floats  # (T, 3) [m/s]
    wrench: Floats  # (T, 4) forward, left, up [N], yaw [N m]: of the person on the walker
    column_m: Floats  # (T,) [m]
    tilt_rad: Floats  # (T,) of the frame
    touched: Floats  # (T,) 1 where a part of the body other than soles and arms was on the floor


class TraceWriter:
    """Notes a trial's state at RATE_HZ and writes it when asked."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rows: list[tuple[Floats, ...]] = []
        self._due_s = 0.0

    def note(self, performance: Performance, stamp_ns: int) -> None:
        """Take down the present moment if the scenario has begun and one is due."""
        world = performance.world
        if performance.waiting or performance.time_s < self._due_s:
            return
        self._due_s += 1.0 / RATE_HZ
        self._rows.append(
            (
                np.array(performance.time_s),
                np.array(float(stamp_ns)),
                world.data.qpos.copy(),
                world.pelvis_m.copy(),
                world.pelvis_velocity_m_s.copy(),
                np.array(world.wrench),
                np.array(world.walker.height_m),
                np.array(world.odometry().tilt),
                np.array(1.0 if world.touched_down() else 0.0),
            )
        )

    def save(self) -> None:
        """Write the file whole or not at all."""
        if not self._rows:
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        part = self._path.with_name(self._path.name + ".part")
        columns = dict(zip(Trace._fields, map(np.stack, zip(*self._rows, strict=True)), strict=True))
        with part.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **columns)
        part.replace(self._path)


def load_trace(path: Path) -> Trace:
    """Read a trace.

    Raises:
        SourceError: it is not there, or not a trace.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return Trace(*(file[name] for name in Trace._fields))
    except (OSError, KeyError, ValueError) as error:
        raise SourceError(f"{path}: cannot be read as a trace of the simulation ({error})") from error
