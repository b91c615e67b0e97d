"""A controller as a real process with certificates, fed as in normal work; and strangers who knock at its door."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import zenoh
from bridge_recordings import _message, horizon
from bridge_toys import PATIENCE_S, ROLES, free_ports, wait_until

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.keys.authority import Pair, create_authority, issue
from bridge.keys.files import make_folder, write, write_pair
from bridge.keys.identity import IDENTITIES
from bridge.messages import NodeStatus
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from bridge.transport.interface import Sample
from bridge.transport.zenoh import ZenohTransport

QUIET = ("inputs.stuck_after_s=0",)  # what is fed here repeats itself


def make_keys(folder: Path, hosts: Sequence[str] = ()) -> Pair:
    """Make an authority and a certificate for everyone in `folder`; return the authority."""
    make_folder(folder)
    authority = create_authority(3650)
    write(folder / "ca.pem", authority.certificate_pem(), 0o644)
    for identity in IDENTITIES:
        write_pair(folder, identity, issue(authority, identity, hosts, 365))
    return authority


def session(endpoint: str, tls: Mapping[str, object] | None = None, mode: str = "peer") -> Any:
    """Return a Zenoh session that is nobody of ours, connected to `endpoint` as soon as it lets it in."""
    settings: dict[str, object] = {
        "mode": mode,
        "connect/endpoints": [endpoint],
        "listen/endpoints": [],
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "open/return_conditions/connect_scouted": False,
    }
    if tls is not None:
        settings["transport/link/tls"] = tls
    config = zenoh.Config()
    for path, value in settings.items():
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


def tls_of(folder: Path, name: str, authority: str = "ca") -> dict[str, object]:
    """Return how somebody with the files of `name` in `folder` connects."""
    return {
        "root_ca_certificate": str(folder / f"{authority}.pem"),
        "enable_mtls": True,
        "connect_private_key": str(folder / f"{name}.key"),
        "connect_certificate": str(folder / f"{name}.pem"),
    }


class Node:
    """One node as a process, with its log in a file."""

    def __init__(self, module: str, log: Path, words: Sequence[str]) -> None:
        self.log = log
        with log.open("wb") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *words], stdin=subprocess.DEVNULL, stdout=file, stderr=file
            )

    @property
    def said(self) -> str:
        return self.log.read_text(encoding="utf-8", errors="replace")

    def close(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Feed:
    """Anticipation and drive: they publish what a calm walk looks like, from a thread, until closed."""

    def __init__(self, anticipation: BridgeConfig, drive: BridgeConfig) -> None:
        self._clock, self._stop = SystemClock(), threading.Event()
        self.running = threading.Event()
        self.running.set()
        self.drive = ZenohTransport(drive, "drive", self._clock)
        self.anticipation = ZenohTransport(anticipation, "anticipation", self._clock)
        self.commands: list[Sample] = []
        self.drive.subscribe(SUPPORT_COMMAND, self.commands.append)
        self._boxes = {topic: Outbox(self.drive, topic) for topic in (WRENCH, ODOMETRY)}
        self._boxes[FALL_HORIZON] = Outbox(self.anticipation, FALL_HORIZON)
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def sent(self, topic: Topic) -> int:
        """Return how many messages of `topic` were published."""
        return self._boxes[topic].sent

    def _publish(self) -> None:
        turn = 0
        while not self._stop.wait(0.01):
            now_ns, turn = self._clock.now_ns(), turn + 1
            for topic in (WRENCH, ODOMETRY):
                self._boxes[topic].send(_message(topic, now_ns, turn, "drive"))
            if self.running.is_set() and turn % 3 == 0:
                self._boxes[FALL_HORIZON].send(horizon(now_ns))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.anticipation.close()
        self.drive.close()


class Statuses:
    """What the controller says of itself, as an observer hears it."""

    def __init__(self, config: BridgeConfig) -> None:
        self._clock = SystemClock()
        self._wire = ZenohTransport(config, "monitor", self._clock)
        self._inbox: Inbox[NodeStatus] = Inbox(self._wire, DIAGNOSTICS, depth=256)
        self.seen: list[NodeStatus] = []

    def newest(self) -> NodeStatus | None:
        """Return the newest status of the controller, None before the first."""
        self.seen += [status for status in self._inbox.drain(self._clock.now_ns()) if status.role == "controller"]
        return self.seen[-1] if self.seen else None

    def value(self, name: str) -> str:
        status = self.newest()
        return "" if status is None else status.values[name]

    def close(self) -> None:
        self._wire.close()


class Site:
    """The controller at work, with certificates: everything a stranger may try to disturb."""

    def __init__(self, folder: Path, overrides: Sequence[str] = ()) -> None:
        self._stack = ExitStack()
        self.folder, self.keys = folder, folder / "keys"
        self.authority = make_keys(self.keys)
        ports = dict(zip(ROLES, free_ports(len(ROLES)), strict=True))
        pairs = [f"bridge.endpoints.{role}=tls/127.0.0.1:{port}" for role, port in ports.items()]
        self.overrides = [f"bridge.keys={self.keys}", *pairs, *QUIET, *overrides]
        self.config = load_config(None, self.overrides).bridge
        words = [word for pair in self.overrides for word in ("--set", pair)]
        with self._stack:
            self.controller = self._stack.enter_context(
                closing(Node("controller.node", folder / "controller.log", [*words, "--option", "controller=log"]))
            )
            self.feed = self._stack.enter_context(closing(Feed(self.config, self.config)))
            self.statuses = self._stack.enter_context(closing(Statuses(self.config)))
            wait_until(lambda: self.statuses.value("state") == "FOLLOW", "the controller follows")
            self._stack = self._stack.pop_all()

    def endpoint(self, role: str) -> str:
        return self.config.endpoints[role]

    def knows(self, text: str) -> None:
        """Wait until the controller's log says `text`."""
        try:
            wait_until(lambda: text in self.controller.said, f"the log says {text!r}")
        except AssertionError as error:
            raise AssertionError(f"{error}; it says {self.controller.said[-2000:]}") from error

    def recovers(self) -> None:
        """Wait until the controller follows, and does its turns."""

        def well() -> bool:
            return self.statuses.value("state") == "FOLLOW" and float(self.statuses.value("rate_hz")) > 60.0

        wait_until(well, "the controller follows again")

    def close(self) -> None:
        self._stack.close()


def key_of(topic: Topic) -> str:
    return f"surefoot/{topic.key}"
