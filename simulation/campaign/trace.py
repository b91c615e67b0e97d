"""What is noted of a trial while it runs: every turn of the world (4 ms), and every horizon."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.messages import FallHorizon, Floats, GaitState, SupportCommand
from simulation.world.world import World

STATES: Final = tuple(GaitState)
UNKNOWN: Final = -1.0


class Trace(NamedTuple):
    """Columns over time; each (T,) unless said otherwise."""

    time_s: Floats
    pelvis_m: Floats  # height
    pelvis_speed_m_s: Floats  # upwards
    walked_m: Floats  # horizontal way of the pelvis from the start
    force_n: Floats  # (T, 3) on the interface, without the sensor's errors: forward, left, up
    power_w: Floats  # that the person spends on moving the interface
    tilt_rad: Floats
    column_m: Floats
    stiffening: Floats
    state: Floats  # index into STATES, UNKNOWN before the first command
    touched: Floats  # 1 from the first contact of pelvis, trunk, head, thigh or knee with the floor on
    horizon_s: Floats  # (H,) when each horizon came
    unsteady_now: Floats  # (H,) probability of transient and fall together at step 0
    falls_now: Floats  # (H,) probability of fall at step 0
    falls_ahead: Floats  # (H,) its largest value over the horizon
    distance: Floats  # (H,) least distance to the fall boundary over the horizon [within-class sd]


class Recorder:
    """Collects a trace; `command` is what the drive executes."""

    def __init__(self, start_ns: int) -> None:
        self._start_ns = start_ns
        self._rows: list[tuple[float, ...]] = []
        self._horizons: list[tuple[float, ...]] = []
        self._last: tuple[float, float] | None = None
        self._walked = 0.0
        self.touched = ""
        self.command: SupportCommand | None = None

    def note(self, world: World) -> None:
        """Take the world as it is."""
        position, velocity, odometry, wrench = (
            world.pelvis_m, world.pelvis_velocity_m_s, world.odometry(), world.wrench,
        )  # fmt: skip
        x, y, z = position.tolist()
        vertical = float(velocity[2])
        if self._last is not None:
            self._walked += float(np.hypot(x - self._last[0], y - self._last[1]))
        self._last = (x, y)
        self.touched = self.touched or world.touched_down()
        forward, left, column = odometry.velocity
        power = wrench.forward_n * forward + wrench.left_n * left + wrench.up_n * column
        power += wrench.yaw_nm * odometry.yaw_rate
        command = self.command
        self._rows.append((
            world.time_s, z, vertical, self._walked, wrench.forward_n, wrench.left_n, wrench.up_n, power, odometry.tilt,
            odometry.position[2], 0.0 if command is None else command.stiffening,
            UNKNOWN if command is None else float(STATES.index(command.state)), float(self.touched != ""),
        ))  # fmt: skip

    def heard(self, now_ns: int, horizon: FallHorizon) -> None:
        """Take a horizon."""
        stable, fall = horizon.probabilities[:, 0], horizon.probabilities[:, 2]
        self._horizons.append((
            (now_ns - self._start_ns) / NS, 1.0 - float(stable[0]), float(fall[0]), float(fall.max()),
            float(horizon.distance.min()),
        ))  # fmt: skip

    def trace(self) -> Trace:
        """Return what was noted."""
        a = np.array(self._rows).T
        h = np.array(self._horizons).reshape(-1, 5).T
        return Trace(a[0], a[1], a[2], a[3], a[4:7].T, *a[7:], *h)
