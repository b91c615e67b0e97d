"""An alarm without a robot: watches one person and calls when a fall is foreseen, happens, or cannot be seen any more.

surefoot up --source camera:0 --roles perception,anticipation
python examples/alarm.py

It judges by the thresholds of `[intervention]` and `[supervisor]`, as the walker would: GUARD is a fall that may come
within half a second, ARREST one that is there, SAFE_STOP that nothing is known. It prints, rings the terminal's
bell, and runs a command of yours with the state and the reason as its last two words:

python examples/alarm.py --option command="notify-send Surefoot" --option every_s=5
"""

from __future__ import annotations

import math
import shlex
import subprocess
import sys
from typing import Final

import numpy as np

from bridge.clock import NS
from bridge.errors import ConfigError
from bridge.inbox import Inbox, Reading
from bridge.messages import FallHorizon, GaitState, NodeStatus, Odometry, Wrench
from bridge.node import NodeContext, main
from bridge.topics import FALL_HORIZON
from controller.intervention.intervention import Intervention

CALLS: Final = {
    GaitState.GUARD: "a fall may come",
    GaitState.ARREST: "FALL",
    GaitState.SAFE_STOP: "not watching",
}
CALM: Final = (GaitState.FOLLOW, GaitState.RECOVER)
KNOWN: Final = ("command", "every_s")


class Alarm:
    """The walker's own judgement of the horizon, with a wrench and an odometry in which nothing ever happens."""

    period_s: float | None = 1.0 / 30.0

    def __init__(self, context: NodeContext) -> None:
        config, options = context.config, context.options
        if unknown := [name for name in options if name not in KNOWN]:
            raise ConfigError(f"alarm option {unknown[0]}: known: {', '.join(KNOWN)}")
        if config.intervention.steps_used == 0:
            raise ConfigError("intervention.steps_used = 0: nobody would ever be called")
        try:
            self._command = shlex.split(options.get("command", ""))
            self._every_s = float(options.get("every_s", "5"))  # of one state; the first is never held back
        except ValueError as error:
            raise ConfigError(f"alarm option command or every_s: {error}") from error
        self._judge = Intervention(config.intervention, config.supervisor, config.mpc.stages, config.mpc.stage_s)
        self._horizon: Inbox[FallHorizon] = Inbox(
            context.transport, FALL_HORIZON, stuck_after_s=config.inputs.stuck_after_s
        )
        self._state, self._reason = GaitState.DISARMED, "waiting for a horizon"
        self._ran_s: dict[GaitState, float] = {}  # when the command last ran for a state
        self._running: list[subprocess.Popen[bytes]] = []

    def step(self, now_ns: int) -> None:
        """Judge the newest horizon and call when the state changes."""
        wrench = Wrench(stamp_ns=now_ns, force=np.zeros(3), torque=np.zeros(3))
        odometry = Odometry(stamp_ns=now_ns, position=np.zeros(3), yaw=0.0, velocity=np.zeros(3), yaw_rate=0.0)
        horizon = self._horizon.read(now_ns)
        decision = self._judge.step(
            now_ns, horizon, Reading(wrench, 0.0, "", fresh=True), Reading(odometry, 0.0, "", fresh=True)
        )
        self._running = [process for process in self._running if process.poll() is None]
        before, self._state = self._state, decision.state
        self._reason = decision.reason.replace(", the support stays stiff", "")  # there is none
        if self._state is not before:
            self._call(now_ns / NS)

    def _call(self, now_s: float) -> None:
        words = CALLS.get(self._state, "all well" if self._state in CALM else "")
        if not words:
            return
        bell = "" if self._state in CALM else "\a"
        print(f"{bell}{words}: {self._reason}", flush=True)
        due = now_s - self._ran_s.get(self._state, -math.inf) >= self._every_s
        if self._command and due and self._state not in CALM:
            self._ran_s[self._state] = now_s
            try:
                call = [*self._command, self._state.value, self._reason]
                self._running.append(subprocess.Popen(call))
            except OSError as error:
                print(f"alarm: {self._command[0]} does not run: {error.strerror}", file=sys.stderr)

    def status(self, now_ns: int) -> NodeStatus:
        """Return what `surefoot up` shows."""
        level = {GaitState.GUARD: 1, GaitState.ARREST: 2, GaitState.SAFE_STOP: 2}.get(self._state, 0)
        words = CALLS.get(self._state, "watching" if self._state in CALM else "waiting")
        return NodeStatus(stamp_ns=now_ns, role="alarm", level=level, summary=f"{words}: {self._reason}")

    def wait(self) -> None:
        """Nothing to wait for: the loop has a period."""

    def finished(self) -> bool:
        """An alarm watches until it is told to stop."""
        return False

    def close(self) -> None:
        """Stop listening; a command that still runs is left to itself."""
        self._horizon.close()


def create(context: NodeContext) -> Alarm:
    """Return the node."""
    return Alarm(context)


if __name__ == "__main__":
    raise SystemExit(main("alarm", create))
