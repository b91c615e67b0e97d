"""The whole system for half an hour at ten times the usual rates: nothing lost, nothing grown.

    python -m benchmarks.soak --json runs/soak.json                  # 30 minutes
    python -m benchmarks.soak --minutes 3
    python -m benchmarks.soak --minutes 10 --times 1                 # every process as shipped, at its own rate

At ten times the rates drive and controller (with the logging mock) are the real processes at 1000 Hz; the networks and
the MPC do not run ten times as fast anywhere, so perception and anticipation are stood in for by nodes that say as
much on the wire, 300 times a second. With `--times 1` nothing is stood in for and the MPC controls. Exit code 1:
a process stopped, memory or the age on arrival grew, or a sample was lost on a topic that promises every one.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from benchmarks.report import machine, report
from benchmarks.soak.measure import Counter, growth_kb, judge, resident_kb
from bridge.clock import SystemClock, nanoseconds
from bridge.config.load import load_config
from bridge.latency.system import ROLES, write_walk
from bridge.launch.launcher import Launcher
from bridge.launch.monitor import Monitor
from bridge.launch.ports import free_ports
from bridge.messages import GaitState
from bridge.topics import TOPICS
from bridge.transport.zenoh import ZenohTransport

REPO: Final = Path(__file__).resolve().parents[2]
STOPPED: Final = (GaitState.DISARMED, GaitState.SAFE_STOP)
SETTLE_S: Final = 5.0
START_LIMIT_S: Final = 120.0
POLL_S: Final = 0.02
MEMORY_S: Final = 2.0


class Soak:
    """The processes, and a listener that counts."""

    def __init__(self, stack: ExitStack, times: float) -> None:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="surefoot-soak-")))
        ports = zip(ROLES, free_ports(len(ROLES)), strict=True)
        overrides = [
            f"bridge.namespace=soak-{os.getpid()}",
            *(f"bridge.endpoints.{role}=tcp/127.0.0.1:{port}" for role, port in ports),
            "launch.restart=false",
            "controller.log_records=10",
        ]
        if times == 1.0:
            write_walk(folder / "walk.npz", 7200.0)
            options = {"perception": {"source": f"{folder / 'walk.npz'}:walk"}}
        else:
            os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(REPO), os.environ.get("PYTHONPATH", ""))))
            overrides += [
                *(f"launch.modules.{role}=benchmarks.soak.stand_ins" for role in ("perception", "anticipation")),
                f"drive.rate_hz={100.0 * times:g}",
                f"controller.rate_hz={100.0 * times:g}",
            ]
            options = {
                "perception": {"role": "perception", "rate_hz": f"{30.0 * times:g}"},
                "anticipation": {"role": "anticipation"},
                "controller": {"controller": "log"},
            }
        config = load_config(None, overrides)
        self.clock = SystemClock()
        self.transport = ZenohTransport(config.bridge, "soak", self.clock)
        stack.callback(self.transport.close)
        self.monitor = Monitor(self.transport, self.clock)
        self.launcher = stack.enter_context(Launcher(config, None, overrides, options))
        self.watchdogs: list[str] = []
        self._held: dict[str, str] = {}

    def start(self) -> None:
        """Start everything and wait until commands are followed."""
        self.launcher.start()
        end_s = time.monotonic() + START_LIMIT_S
        while True:
            states, view = self.launcher.poll(), self.monitor.look()
            command = view.command.message
            if command is not None and command.valid and command.state not in STOPPED:
                break
            if time.monotonic() > end_s:
                raise SystemExit("; ".join(f"{p.role} {p.phase} {p.last_line}" for p in states.values()))
            time.sleep(POLL_S)
        time.sleep(SETTLE_S)
        self.monitor.look()

    def run(self, seconds: float) -> dict[str, Any]:
        """Listen for `seconds` and return what was seen."""
        begin_ns = self.clock.now_ns()
        counters = [Counter(topic, begin_ns, begin_ns + nanoseconds(seconds)) for topic in TOPICS]
        handles = [self.transport.subscribe(counter.topic, counter.note) for counter in counters]
        memory: dict[str, list[float]] = {role: [] for role in ROLES}
        memory_due_s = time.monotonic()
        end_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < end_s:
            if now_s >= memory_due_s:
                memory_due_s += MEMORY_S
                for role, process in self.launcher.poll().items():
                    memory[role].append(resident_kb(process.pid))
            self._look()
            time.sleep(POLL_S)
        for handle in handles:
            handle.close()
        topics = {counter.topic.key: counter.result() for counter in counters}
        view = self.monitor.look()
        statuses = {role: dict(seen.status.values) for role, seen in view.roles.items() if seen.status is not None}
        return {
            "seconds": seconds,
            "problems": judge(topics, memory, self.watchdogs),
            "topics": topics,
            "memory_kb": {role: [min(s), max(s), round(growth_kb(s))] for role, s in memory.items() if s},
            "last_status": statuses,
            "machine": machine(),
        }

    def _look(self) -> None:
        """Note every stop, by the controller's commands and by what the drive and the launcher say."""
        view = self.monitor.look()
        command = view.command.message
        said = {"controller": "" if command is None or command.state not in STOPPED else command.reason}
        drive = view.roles.get("drive")
        if drive is not None and drive.status is not None:
            said["drive"] = drive.status.summary if drive.status.summary.startswith("holds") else ""
        for role, process in self.launcher.poll().items():
            if not process.alive:
                said[role] = f"{role} {process.phase}: {process.last_line}"
        for who, text in said.items():
            if text and not self._held.get(who):
                self.watchdogs.append(f"{who}: {text}")
            self._held[who] = text


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--times", type=float, default=10.0, help="of the usual rates; 1 runs every process as shipped")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    with ExitStack() as stack:
        soak = Soak(stack, arguments.times)
        soak.start()
        print(f"soaking for {arguments.minutes:g} minutes", file=sys.stderr, flush=True)
        result = {"times": arguments.times, **soak.run(60.0 * arguments.minutes)}
    report(result, arguments.json)
    return 1 if result["problems"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
