"""What the controller commands, what the walker does, and what the person's hands and harness pull."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from bridge.colours import FALL, FORECAST, STABLE, STATE_COLOUR, TRANSIENT, rgb
from bridge.messages import GaitState, Odometry, SupportCommand, Wrench
from bridge.view.canvas import Canvas

STIFFENING: Final = "series/stiffening"
VELOCITY: Final = "series/velocity"  # below it an axis, below that commanded and measured
HEIGHT_COMMAND: Final = "series/column/commanded"
HEIGHT: Final = "series/column/measured"
DAMPING: Final = "series/admittance/damping"
STIFFNESS: Final = "series/admittance/stiffness"
FORCE: Final = "series/force"
TORQUE: Final = "series/torque"
SOLVE: Final = "series/solve_time"
STATE: Final = "state/control"
SUPERVISOR: Final = f"{STATE}/supervisor"
LAW: Final = f"{STATE}/law"

AXES: Final = ("forward", "left", "yaw", "height")
_BRIGHT: Final = (FORECAST, TRANSIENT, "#b98bdc", "#7ccf7c")  # forward, left, yaw, height
_MEASURED: Final = "#f2f2f2"
_LAWS: Final = {"mpc": STABLE, "fallback": TRANSIENT, "stop": FALL}
_NAN: Final = math.nan


class ControlPanel:
    """Curves and states over the trial."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._shown: dict[str, str] = {}  # state lane -> what it shows
        canvas.curves(STIFFENING, ("stiffening",), ("#b98bdc",), (2.5,))
        for axis, bright in zip(AXES, _BRIGHT, strict=True):
            canvas.curves(f"{VELOCITY}/{axis}/commanded", ("commanded",), (bright,), (2.5,))
            canvas.curves(f"{VELOCITY}/{axis}/measured", ("measured",), (_MEASURED,), (1.2,))
        canvas.curves(HEIGHT_COMMAND, ("commanded",), (_BRIGHT[3],), (2.5,))
        canvas.curves(HEIGHT, ("measured",), (_MEASURED,), (1.2,))
        canvas.curves(DAMPING, [f"D {axis}" for axis in AXES], _BRIGHT, (1.8,) * 4)
        canvas.curves(STIFFNESS, [f"K {axis}" for axis in AXES], _BRIGHT, (1.8,) * 4)
        canvas.curves(FORCE, ("x", "y", "z up"), _BRIGHT[:3], (1.8,) * 3)
        canvas.curves(TORQUE, ("x", "y", "z"), _BRIGHT[:3], (1.5,) * 3)
        canvas.curves(SOLVE, ("controller step [ms]",), (_BRIGHT[0],), (1.2,))
        self._lane(SUPERVISOR, {state.value: STATE_COLOUR[state.value] for state in GaitState})
        self._lane(LAW, _LAWS)

    def command(self, command: SupportCommand) -> None:
        """Draw one command."""
        canvas = self._canvas
        canvas.plot(STIFFENING, (command.stiffening,))
        self._velocity("commanded", command.velocity.tolist())
        canvas.plot(HEIGHT_COMMAND, (command.column_height,))
        canvas.plot(DAMPING, command.damping.tolist())
        canvas.plot(STIFFNESS, command.stiffness.tolist())
        canvas.plot(SOLVE, (1e3 * command.solve_time_s,))
        self._show(SUPERVISOR, command.state.value)
        self._show(LAW, command.solver)

    def no_command(self) -> None:
        """Leave a gap: no command comes, or one that must not be followed."""
        canvas = self._canvas
        canvas.plot(STIFFENING, (_NAN,))
        canvas.plot(HEIGHT_COMMAND, (_NAN,))
        canvas.plot(SOLVE, (_NAN,))
        for path in (DAMPING, STIFFNESS):
            canvas.plot(path, (_NAN,) * 4)
        self._velocity("commanded", (_NAN,) * 4)
        self._show(SUPERVISOR, "")
        self._show(LAW, "")

    def odometry(self, odometry: Odometry) -> None:
        """Draw how the walker moves."""
        forward, left, column = odometry.velocity.tolist()
        self._velocity("measured", (forward, left, odometry.yaw_rate, column))
        self._canvas.plot(HEIGHT, (float(odometry.position[2]),))

    def no_odometry(self) -> None:
        """Leave a gap."""
        self._velocity("measured", (_NAN,) * 4)
        self._canvas.plot(HEIGHT, (_NAN,))

    def wrench(self, wrench: Wrench) -> None:
        """Draw what the person pulls and leans with."""
        self._canvas.plot(FORCE, wrench.force.tolist())
        self._canvas.plot(TORQUE, wrench.torque.tolist())

    def no_wrench(self) -> None:
        """Leave a gap."""
        self._canvas.plot(FORCE, (_NAN,) * 3)
        self._canvas.plot(TORQUE, (_NAN,) * 3)

    def _velocity(self, kind: str, values: Sequence[float]) -> None:
        for axis, value in zip(AXES, values, strict=True):
            self._canvas.plot(f"{VELOCITY}/{axis}/{kind}", (value,))

    def _lane(self, path: str, colours: dict[str, str]) -> None:
        values = list(colours)
        self._canvas.fix(
            path, self._canvas.sdk.StateConfiguration(values=values, colors=[rgb(colours[value]) for value in values])
        )

    def _show(self, path: str, state: str) -> None:
        """Begin a new stretch of a lane when its state changes; '' leaves a gap."""
        if self._shown.get(path, "") != state:
            self._shown[path] = state
            self._canvas.draw(path, self._canvas.sdk.StateChange(state=state))
