"""The real processes under test and what they say: through the relay, or on their own wire as they run live."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Self

from benchmarks.faults.relay import READERS, Relay
from bridge.clock import SystemClock
from bridge.codec import decode
from bridge.config.load import load_config
from bridge.errors import InvalidMessage
from bridge.latency.system import ROLES, write_walk
from bridge.launch.launcher import Launcher, Phase, ProcessState
from bridge.launch.ports import free_ports
from bridge.messages import GaitState, Message, NodeStatus, Odometry, SupportCommand
from bridge.topics import DIAGNOSTICS, ODOMETRY, SUPPORT_COMMAND, Topic
from bridge.transport.interface import Sample
from bridge.transport.zenoh import ZenohTransport

# The drive shows what its gate executes without the lag of a base; recovery is short, so that the rows follow each
# other quickly. Nothing that is measured depends on either.
OVERRIDES: Final = (
    "drive.base_lag_s=0",
    "drive.column_lag_s=0",
    "supervisor.recover_s=0.3",
    "supervisor.recover_per_s=3",
    "launch.restart_limit=50",
)
WALK_S: Final = 1200.0
POLL_S: Final = 0.005
TOPICS: Final = (*READERS, DIAGNOSTICS)


class Heard:
    """One message as it left its publisher, with who sent it and when it got here."""

    __slots__ = ("arrival_ns", "message", "sequence", "source")

    def __init__(self, arrival_ns: int, message: Any, sequence: int, source: bytes) -> None:
        self.arrival_ns, self.message, self.sequence, self.source = arrival_ns, message, sequence, source


class System:
    """Four processes of one robot; what they publish is in `heard`, by topic."""

    def __init__(self, extra: Sequence[str] = (), script: str = "walk", **drive: str) -> None:
        self.clock = SystemClock()
        self.heard: dict[str, list[Heard]] = {topic.key: [] for topic in TOPICS}
        self.spoilt: list[str] = []  # what a node published and nobody can read
        self.stack = ExitStack()
        self._folder = Path(self.stack.enter_context(TemporaryDirectory(prefix="surefoot-faults-")))
        write_walk(self._folder / "walk.npz", WALK_S)
        self.options: dict[str, dict[str, str]] = {
            "perception": {"source": f"{self._folder / 'walk.npz'}:walk"},
            "drive": {"script": script, **drive},
        }
        self.ports = dict(zip((*ROLES, "relay"), free_ports(len(ROLES) + 1), strict=True))
        self.endpoints = [f"bridge.endpoints.{role}=tcp/127.0.0.1:{self.ports[role]}" for role in ROLES]
        self.overrides = [*OVERRIDES, *self.endpoints, *extra]
        self.gate = load_config(None, self.overrides).gate
        self.launchers: dict[str, Launcher] = {}
        self.processes: dict[str, ProcessState] = {}

    def look(self) -> None:
        """Take in what was said, and start again what died."""
        for launcher in dict.fromkeys(self.launchers.values()):
            self.processes.update(launcher.poll())
        self.listen()

    def listen(self) -> None:
        """Append what arrived to `heard`."""
        raise NotImplementedError

    def forget(self, keep_s: float = 0.0) -> None:
        """Drop what was heard longer ago than `keep_s`."""
        since_ns = self.clock.now_ns() - int(keep_s * 1e9)
        for key, log in self.heard.items():
            self.heard[key] = [entry for entry in log if entry.arrival_ns >= since_ns]

    def run_for(self, seconds: float) -> None:
        """Look for `seconds`."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.look()
            time.sleep(POLL_S)

    def until(self, condition: Callable[[], object], what: str, limit_s: float = 60.0) -> bool:
        """Look until `condition` holds; return whether it did within `limit_s`, and say so if not."""
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                print(f"{what}: not within {limit_s:g} s; {self.describe()}", flush=True)
                return False
            self.look()
            time.sleep(POLL_S)
        return True

    def describe(self) -> str:
        """Return in words how everything is."""
        command = self.command()
        said = "no command" if command is None else f"{command.state.value}: {command.reason}"
        return f"{said}; " + "; ".join(f"{p.role} {p.phase} {p.last_line[-160:]}" for p in self.processes.values())

    def newest(self, topic: Topic) -> Any:
        """Return the newest message of `topic`, or None."""
        log = self.heard[topic.key]
        return log[-1].message if log else None

    def command(self) -> SupportCommand | None:
        """Return the controller's newest command."""
        command: SupportCommand | None = self.newest(SUPPORT_COMMAND)
        return command

    def walking(self, speed_m_s: float = 0.15) -> bool:
        """Whether the walker follows the person and moves, as the drive itself says."""
        command, odometry = self.command(), self.newest(ODOMETRY)
        return (
            command is not None
            and command.valid
            and command.solver == "mpc"
            and command.state in (GaitState.FOLLOW, GaitState.GUARD)
            and isinstance(odometry, Odometry)
            and float(odometry.velocity[0]) > speed_m_s
        )

    def statuses(self, role: str) -> list[NodeStatus]:
        """Return what `role` said of itself."""
        return [entry.message for entry in self.heard[DIAGNOSTICS.key] if entry.message.role == role]

    def signal(self, role: str, number: signal.Signals) -> None:
        """Send `number` to the process of `role`."""
        os.kill(self.processes[role].pid, number)

    def running(self, role: str) -> bool:
        """Whether the process of `role` runs."""
        return role in self.processes and self.processes[role].phase is Phase.RUNNING

    def start(self, ready: Callable[[], object] | None = None) -> None:
        """Start everything, perception last, and wait until the walker walks, or is `ready` for what is to come.

        Raises:
            SystemExit: it does not.
        """
        for role in ("drive", "anticipation", "controller"):
            self.launchers[role].start([role])
        heard = self.heard
        up = self.until(lambda: heard["fall_horizon"] and heard["support_command"] and heard["odom"], "start", 120.0)
        self.launchers["perception"].start(["perception"])
        if not (up and self.until(ready or self.walking, "first steps", 90.0)):
            raise SystemExit(f"the system did not start: {self.describe()}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.stack.close()

    def hear(self, topic: Topic, arrival_ns: int, payload: bytes, sequence: int, source: bytes) -> None:
        """Keep one message."""
        try:
            message: Message = decode(topic, payload, max(sequence, 0))
        except InvalidMessage as error:
            print(f"{topic.key} of {source.hex()} number {sequence}: {error}: {payload.hex()}", flush=True)
            self.spoilt.append(f"{topic.key}: {error}")
            return
        self.heard[topic.key].append(Heard(arrival_ns, message, sequence, source))


class RelayedSystem(System):
    """Each process in a namespace of its own, joined by the relay alone."""

    def __init__(self, extra: Sequence[str] = (), script: str = "walk", **drive: str) -> None:
        super().__init__(extra, script, **drive)
        base = f"faults{os.getpid()}"
        self.relay = self.stack.enter_context(Relay(self.ports["relay"], base, self.clock))
        for role in ROLES:
            own = [
                *self.overrides,
                f"bridge.namespace={base}/{role}",
                f'bridge.connect=["tcp/127.0.0.1:{self.ports["relay"]}"]',
                f'launch.roles=["{role}"]',
            ]
            self.launchers[role] = self.stack.enter_context(
                Launcher(load_config(None, own), None, own, {role: self.options.get(role, {})})
            )

    def listen(self) -> None:
        for topic in TOPICS:
            seen = self.relay.seen[topic.key]
            while seen:
                sample = seen.popleft()
                number, source = int.from_bytes(sample.attachment[:8], "little"), sample.attachment[17:]
                self.hear(topic, sample.arrival_ns, sample.payload, number, source)


class DirectSystem(System):
    """The processes as `surefoot up` runs them, with a listener beside them."""

    def __init__(
        self,
        extra: Sequence[str] = (),
        script: str = "walk",
        *,
        namespace: str | None = None,
        connect: Sequence[str] = (),
        options: Mapping[str, Mapping[str, str]] | None = None,
        **drive: str,
    ) -> None:
        super().__init__(extra, script, **drive)
        self.overrides.append(f"bridge.namespace={namespace or f'faults{os.getpid()}'}")
        if connect:
            self.overrides.append("bridge.connect=[" + ", ".join(f'"{endpoint}"' for endpoint in connect) + "]")
        for role, given in (options or {}).items():
            self.options.setdefault(role, {}).update(given)
        self.config = load_config(None, self.overrides)
        launcher = self.stack.enter_context(Launcher(self.config, None, self.overrides, self.options))
        self.launchers = dict.fromkeys(ROLES, launcher)
        transport = ZenohTransport(self.config.bridge, "faults", self.clock)
        self.stack.callback(transport.close)
        self._waiting: dict[str, list[Sample]] = {topic.key: [] for topic in TOPICS}
        for topic in TOPICS:
            transport.subscribe(topic, self._waiting[topic.key].append)

    def listen(self) -> None:
        for topic in TOPICS:
            waiting = self._waiting[topic.key]
            while waiting:
                sample = waiting.pop(0)
                self.hear(topic, sample.arrival_ns, sample.payload, sample.sequence, sample.source)
