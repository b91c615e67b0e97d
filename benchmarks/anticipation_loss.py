"""SIGKILL of the anticipation process: how long until the command is the safe one?

    python -m benchmarks.anticipation_loss --times 10 --json runs/bench/anticipation_loss.json

The design allows 200 ms after the last horizon. Every time, three spans to the first
SAFE_STOP command: from the stamp of the last horizon (its newest frame) to the command's stamp,
from the last horizon's arrival to the command's arrival, both at an observer, and from the kill.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import time
from pathlib import Path
from typing import Any

from benchmarks.live import Live, machine, percentiles, report
from bridge.clock import SystemClock
from bridge.launch.launcher import Phase
from bridge.messages import GaitState

MS = 1e6
LIMIT_MS = 200.0


def kill_once(live: Live) -> dict[str, float] | None:
    """Kill anticipation at a random phase of the frame period and return the three spans [ms].

    None if the controller had stopped for another reason just before, as it does on a machine with too little time.
    """
    live.until(lambda: live.alive("anticipation") and live.following(), "command that follows")
    time.sleep(random.uniform(0.0, 0.1))
    live.look()
    live.commands.clear()
    killed_ns = SystemClock().now_ns()
    os.kill(live.processes["anticipation"].pid, signal.SIGKILL)
    live.until(lambda: any(c.state is GaitState.SAFE_STOP for c, _ in live.commands), "safe command", 5.0)
    command, arrival_ns = next((c, t) for c, t in live.commands if c.state is GaitState.SAFE_STOP)
    if "horizon" not in command.reason or command.stamp_ns < killed_ns:
        return None
    horizon, horizon_arrival_ns = next((h, t) for h, t in reversed(live.horizons) if h.valid)
    return {
        "stamp_to_stamp": (command.stamp_ns - horizon.stamp_ns) / MS,
        "arrival_to_arrival": (arrival_ns - horizon_arrival_ns) / MS,
        "kill_to_arrival": (arrival_ns - killed_ns) / MS,
    }


def measure(times: int, controller: str, overrides: list[str]) -> dict[str, Any]:
    """Kill `times` times, starting the process again in between, and return the percentiles."""
    trials: list[dict[str, float]] = []
    spoilt = 0
    with Live(60.0 + 20.0 * times, controller, ["launch.restart=false", *overrides]) as live:
        live.start()
        while len(trials) < times and spoilt < times:
            trial = kill_once(live)
            if trial is None:
                spoilt += 1
            else:
                trials.append(trial)
            live.until(lambda: live.processes["anticipation"].phase is Phase.FAILED, "death seen")
            live.launcher.start(["anticipation"])
            live.until(lambda: live.processes["anticipation"].alive and live.alive("anticipation"), "back again")
        load = machine()
    if not trials:
        raise SystemExit(f"the controller stopped for other reasons in each of {spoilt} trials")
    spans = {name: percentiles([trial[name] for trial in trials]) for name in trials[0]}
    over = sum(max(trial["stamp_to_stamp"], trial["arrival_to_arrival"]) > LIMIT_MS for trial in trials)
    return {
        "machine": load,
        "controller": controller,
        "times": len(trials),
        "spoilt": spoilt,
        "limit_ms": LIMIT_MS,
        "over_limit": over,
        **spans,
    }


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--controller", choices=("mpc", "log"), default="mpc")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result = measure(arguments.times, arguments.controller, arguments.set)
    report(result, arguments.json)


if __name__ == "__main__":
    main()
