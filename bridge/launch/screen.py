"""What is seen of the running system: a table for a terminal, a line for a pipe, a record for a program."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.console import Group
from rich.table import Table
from rich.text import Text

from bridge.launch.launcher import Phase, ProcessState
from bridge.launch.monitor import RoleView, View
from bridge.messages import NodeStatus, SupportCommand

_LEVELS = ("green", "yellow", "red", "red")  # ok, warning, error, stale, as in diagnostic_msgs
_UNKNOWN = RoleView(False, None, float("inf"))
_STATUS_MAX_AGE_S = 1.0  # three reports in a row were missed: what they said is no longer so


def table(elapsed_s: float, processes: Mapping[str, ProcessState], view: View, notice: str = "") -> Group:
    """Return the screen: one row per role, and what the controller does."""
    grid = Table(title=f"surefoot up  {elapsed_s:6.1f} s", title_justify="left", expand=True)
    for name in ("role", "state", "wire", "pid", "rate [Hz]", "age of inputs [ms]", "restarts"):
        grid.add_column(
            Text(name), justify="right" if name in {"pid", "rate [Hz]", "restarts"} else "left", no_wrap=True
        )
    grid.add_column("says", ratio=1, no_wrap=True, overflow="ellipsis")
    for role in _roles(processes, view):
        seen, process = view.roles.get(role, _UNKNOWN), processes.get(role)
        grid.add_row(
            role,
            Text(process.phase if process else "elsewhere", style=_phase_style(process)),
            Text("alive", style="green") if seen.alive else Text("-", style="red"),
            str(process.pid) if process and process.alive else "",
            _value(seen, "rate_hz"),
            "  ".join(f"{name} {age}" for name, age in _ages(seen).items()),
            str(process.restarts) if process else "",
            _summary(process, seen),
        )
    return Group(grid, Text(_command_line(view)), Text(notice, style="bold"))


def line(elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> str:
    """Return the same on one line."""
    roles = []
    for role in _roles(processes, view):
        seen, process = view.roles.get(role, _UNKNOWN), processes.get(role)
        rate = _value(seen, "rate_hz")
        how = f"{rate} Hz" if seen.alive and rate else (process.phase if process else "elsewhere")
        again = f" (restarted {process.restarts}x)" if process and process.restarts else ""
        roles.append(f"{role} {how}{again}")
    return f"{elapsed_s:6.1f} s  {', '.join(roles)} | {_command_line(view)}"


def record(elapsed_s: float, processes: Mapping[str, ProcessState], view: View) -> dict[str, object]:
    """Return the same as plain values, None where unknown, ready for JSON."""
    command = view.command.message
    roles: dict[str, object] = {}
    for role in _roles(processes, view):
        seen, process = view.roles.get(role, _UNKNOWN), processes.get(role)
        roles[role] = {
            "alive": seen.alive,
            "phase": str(process.phase) if process else None,
            "pid": process.pid if process and process.alive else None,
            "restarts": process.restarts if process else None,
            "exit_code": process.exit_code if process else None,
            "summary": seen.status.summary if seen.status else None,
            "values": dict(seen.status.values) if seen.status else {},
        }
    return {
        "elapsed_s": round(elapsed_s, 3),
        "roles": roles,
        "fault": view.command.fault,
        "command": None if command is None else _command_record(command),
    }


def _command_record(command: SupportCommand) -> dict[str, object]:
    return {
        "state": str(command.state),
        "reason": command.reason,
        "stiffening": command.stiffening,
        "fall_distance": _finite(command.fall_distance),
        "fall_probability": _finite(command.fall_probability),
        "velocity": command.velocity.tolist(),
        "solver": command.solver,
    }


def _command_line(view: View) -> str:
    command = view.command.message
    if command is None:
        return view.command.fault
    forward, left, yaw, column = (value + 0.0 for value in command.velocity.round(2))  # + 0.0: no minus zero
    text = (
        f"{command.state}  stiffening {command.stiffening:.2f}  distance {_number(command.fall_distance)} sd"
        f"  fall {_number(command.fall_probability)}  velocity {forward:.2f} {left:.2f} m/s, {yaw:.2f} rad/s"
        f", column {column:.2f} m/s"
    )
    said = [part for part in (command.reason, view.command.fault) if part]
    return f"{text}  ({'; '.join(said)})" if said else text


def _roles(processes: Mapping[str, ProcessState], view: View) -> list[str]:
    return [*processes, *(role for role in view.roles if role not in processes)]


def _current(seen: RoleView) -> NodeStatus | None:
    """Return the role's last report if it still describes the present."""
    return seen.status if seen.alive and seen.age_s <= _STATUS_MAX_AGE_S else None


def _value(seen: RoleView, name: str) -> str:
    status = _current(seen)
    return "" if status is None else status.values.get(name, "")


def _ages(seen: RoleView) -> dict[str, str]:
    """Return the ages that a role reports, by the input's name."""
    status = _current(seen)
    values = {} if status is None else status.values
    return {
        name.replace("age_ms", "").strip("_.") or "input": value for name, value in values.items() if "age_ms" in name
    }


def _summary(process: ProcessState | None, seen: RoleView) -> Text:
    if process is not None and process.phase in {Phase.FAILED, Phase.REFUSED}:
        return Text(process.last_line or f"exit code {process.exit_code}", style="red")
    status = _current(seen)
    return Text("") if status is None else Text(status.summary, style=_LEVELS[min(max(status.level, 0), 3)])


def _phase_style(process: ProcessState | None) -> str:
    if process is None:
        return "dim"
    return {Phase.RUNNING: "green", Phase.FAILED: "red", Phase.REFUSED: "red"}.get(process.phase, "yellow")


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
