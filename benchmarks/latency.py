"""From a frame's capture to the command that rests on it, through the real processes on the real wire.

    python -m benchmarks.latency --seconds 30 --json runs/bench/latency.json

For every frame, the first command that rests on it counts. Three spans, all from the
frame's stamp: to the keypoints' arrival, to the horizon's arrival, to the command's arrival at an observer (a
fifth process); and to the command's own stamp, when the controller began to compute it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.live import Live, machine, percentiles, report
from bridge.clock import NS
from bridge.messages import SupportCommand

MS = 1e6  # nanoseconds in one


def measure(seconds: float, controller: str, overrides: list[str]) -> dict[str, Any]:
    """Run for `seconds` after the first command that follows, and return the percentiles."""
    with Live(seconds + 30.0, controller, overrides) as live:
        live.start()
        start_ns = live.commands[-1][0].stamp_ns
        live.until(lambda: live.commands[-1][0].stamp_ns > start_ns + seconds * NS, "measuring", seconds + 30.0)
        load = machine()
    first = first_on_each_frame((c, t) for c, t in live.commands if c.stamp_ns >= start_ns and c.rests_on_ns)
    solved = [c for c, _ in live.commands if c.stamp_ns >= start_ns and c.solver == "mpc"]
    states = [c.state.value for c, _ in live.commands if c.stamp_ns >= start_ns]
    result: dict[str, Any] = {
        "machine": load,
        "controller": controller,
        "seconds": seconds,
        "frame_to_keypoints": spans((m.stamp_ns, t) for m, t in live.keypoints if m.stamp_ns >= start_ns),
        "frame_to_horizon": spans((m.stamp_ns, t) for m, t in live.horizons if m.stamp_ns >= start_ns and m.valid),
        "frame_to_command_computed": spans((c.rests_on_ns, c.stamp_ns) for c, _ in first),
        "frame_to_command_on_the_wire": spans((c.rests_on_ns, t) for c, t in first),
        "states": {state: states.count(state) for state in sorted(set(states))},
    }
    if solved:
        result["controller_solve"] = percentiles([c.solve_time_s * 1e3 for c in solved])
    return result


def first_on_each_frame(commands: Iterable[tuple[SupportCommand, int]]) -> list[tuple[SupportCommand, int]]:
    """Return the first command of those that rest on the same frame; the very first may not be one and is left out."""
    first: list[tuple[SupportCommand, int]] = []
    for command, arrival_ns in commands:
        if not first or command.rests_on_ns != first[-1][0].rests_on_ns:
            first.append((command, arrival_ns))
    return first[1:]


def spans(pairs: Iterable[tuple[int, int]]) -> dict[str, float]:
    """Return the percentiles of the spans between two stamps [ns] each."""
    return percentiles([(end - start) / MS for start, end in pairs])


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--controller", choices=("mpc", "log"), default="mpc")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.KEY=VALUE")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result = measure(arguments.seconds, arguments.controller, arguments.set)
    report(result, arguments.json)


if __name__ == "__main__":
    main()
