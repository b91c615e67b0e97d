"""The real controller process at its real rate: missed periods, period error, solve times, memory.

    python -m benchmarks.loop --seconds 60 --json runs/bench/loop.json
    python -m benchmarks.loop --seconds 20 --stress --json runs/bench/loop_stress.json

Controller and drive run as processes on the wire; horizons come from here: a walk with a foreseen fall every six
seconds. When a turn began is read from the stamps of the commands, not from what the controller says of itself. The
controller has the last core to itself. With `--stress` a busy process sits on every core, first against the
ordinary loop, then against one under SCHED_FIFO.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import machine, report
from bridge.clock import NS, SystemClock
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.launch.launcher import Launcher
from bridge.launch.observer import Tap
from bridge.launch.ports import free_ports
from bridge.messages import STEPS, FallHorizon, NodeStatus, SupportCommand
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, SUPPORT_COMMAND
from bridge.transport.zenoh import ZenohTransport

ROLES = ("anticipation", "controller", "drive")
FRAME_NS = NS // 30
CYCLE_S = 6.0
SETTLE_S = 3.0  # before counting: armed, following, warm
PRIORITY = 20


def horizon(t: float, stamp_ns: int) -> FallHorizon:
    """Return what is foreseen at `t` [s]: steady walking, and in the last second and a half of a cycle a fall."""
    ahead = t % CYCLE_S + np.arange(STEPS) / 30.0
    into_fall = np.clip((ahead - (CYCLE_S - 1.5)) / 0.7, 0.0, 1.0) * (ahead < CYCLE_S)
    distance = 4.0 + 0.4 * np.sin(2 * np.pi * 1.8 * ahead) - 5.0 * into_fall
    probabilities = np.stack([0.95 - 0.95 * into_fall, np.full(STEPS, 0.05), 0.95 * into_fall], axis=1)
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=probabilities,
        distance=distance,
        distance_rate=np.gradient(distance, 1.0 / 30.0),
        time_to_boundary=np.full(STEPS, np.inf),
        centre_distance=np.zeros((STEPS, 3)),
        plane=np.zeros((STEPS, 2)),
        forecast_px=np.zeros((STEPS, 12, 2)),
        quality=1.0,
    )


@contextmanager
def busy_cores() -> Any:
    """Keep every core busy with a process of ordinary priority."""
    hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        for core, hog in enumerate(hogs):
            os.sched_setaffinity(hog.pid, {core})
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def measure(seconds: float, overrides: list[str]) -> dict[str, Any]:
    """Run for `seconds` after settling."""
    own = [f"bridge.endpoints.{role}=tcp/127.0.0.1:{port}" for role, port in zip(ROLES, free_ports(3), strict=True)]
    everything = [f"bridge.namespace=loop-{os.getpid()}", 'launch.roles=["controller","drive"]', *own, *overrides]
    config = load_config(None, everything)
    clock = SystemClock()
    commands: list[tuple[SupportCommand, int]] = []
    memory: list[int] = []
    with ExitStack() as stack:
        transport = ZenohTransport(config.bridge, "anticipation", clock)
        stack.callback(transport.close)
        tap = Tap(transport, SUPPORT_COMMAND)
        diagnostics: Inbox[NodeStatus] = Inbox(transport, DIAGNOSTICS, max_age_s=float("inf"), depth=64)
        outbox = Outbox(transport, FALL_HORIZON)
        launcher = stack.enter_context(Launcher(config, None, everything, {"drive": {"script": "walk"}}))
        launcher.start()
        pid = launcher.poll()["controller"].pid
        values: dict[str, str] = {}
        start_ns = due_ns = clock.now_ns()
        first_ns = None
        while first_ns is None or clock.now_ns() < first_ns + (SETTLE_S + seconds) * NS:
            clock.sleep_until(due_ns)
            due_ns += FRAME_NS
            now_ns = clock.now_ns()
            outbox.send(horizon((now_ns - start_ns) / NS, now_ns))
            commands.extend(tap.drain())  # type: ignore[arg-type]
            for status in diagnostics.drain(now_ns):
                if status.role == "controller":
                    values = status.values
            if first_ns is None:
                if commands and commands[-1][0].solver == "mpc":
                    first_ns = commands[-1][0].stamp_ns
                    _alone(pid, launcher.poll()["drive"].pid)
                elif now_ns > start_ns + 60 * NS:
                    raise SystemExit(f"no command from a plan within 60 s: {launcher.poll()['controller'].last_line}")
            elif outbox.sent % 10 == 0:
                memory.append(_resident_bytes(pid))
        commands.extend(tap.drain())  # type: ignore[arg-type]
    period_ns = round(NS / config.controller.rate_hz)
    counted = [c for c, _ in commands if first_ns + SETTLE_S * NS <= c.stamp_ns]
    return {"scheduling": values.get("scheduling", ""), **_timing(counted, period_ns), **_itself(values, memory)}


def _alone(controller: int, drive: int) -> None:
    """Give the controller, every thread of it, the last core; the drive and this process the others."""
    *others, last = sorted(os.sched_getaffinity(controller))
    for pid, cores in ((controller, {last}), (drive, set(others)), (os.getpid(), set(others))):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), cores or {last})


def _timing(commands: list[SupportCommand], period_ns: int) -> dict[str, Any]:
    starts = np.array([command.stamp_ns for command in commands])
    lost = np.diff([command.sequence for command in commands]).sum() + 1 - len(commands)
    periods = np.diff(starts)
    # the grid the turns should be on goes through the first of them; what is left is how late each began
    turn = np.round((starts - starts[0]) / period_ns)
    late = starts - starts[0] - turn * period_ns
    second = round(NS / period_ns)
    return {
        "seconds": round(float((starts[-1] - starts[0]) / NS), 2),
        "turns": len(starts),
        "missed_periods": round(float((starts[-1] - starts[0]) / period_ns)) - len(periods),
        "commands_lost_on_the_wire": int(lost),
        "period_error_ms": _three(np.abs(periods - period_ns) / 1e6),
        "phase_drift_ms": round(float((late[-second:].min() - late[:second].min()) / 1e6), 4),
        "solve_ms": _three(np.array([c.solve_time_s for c in commands if c.solver == "mpc"]) * 1e3),
        "solvers": {name: sum(c.solver == name for c in commands) for name in sorted({c.solver for c in commands})},
        "states": sorted({c.state.value for c in commands}),
    }


def _itself(values: dict[str, str], memory: list[int]) -> dict[str, Any]:
    """What the controller says of itself, and what it takes of the memory."""
    said = {key: value for key, value in values.items() if key.partition("_ms")[0] in ("period_error", "solve", "turn")}
    quarter = max(len(memory) // 4, 1)
    return {
        "controller_says": {key: values.get(key, "") for key in ("missed_periods", "overruns")} | said,
        "resident_mb": round(memory[-1] / 2**20, 1),
        "resident_growth_kb": round((float(np.mean(memory[-quarter:])) - float(np.mean(memory[:quarter]))) / 2**10, 1),
    }


def _resident_bytes(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _three(values: np.ndarray) -> dict[str, float]:
    p50, p99 = np.percentile(values, [50, 99]).tolist()
    return {"p50": round(p50, 4), "p99": round(p99, 4), "max": round(float(values.max()), 4)}


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--stress", action="store_true", help="with a busy process on every core")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result: dict[str, Any] = {"machine": machine(), "period_ms": 10.0}
    if arguments.stress:
        with busy_cores():
            result["stress"] = measure(arguments.seconds, arguments.set)
            fifo = [*arguments.set, f"controller.realtime_priority={PRIORITY}"]
            result["stress_fifo"] = measure(arguments.seconds, fifo)
    else:
        result["idle"] = measure(arguments.seconds, arguments.set)
    report(result, arguments.json)


if __name__ == "__main__":
    main()
