"""One of two hosts, each in a network namespace of its own: `far` foresees, `near` listens and pulls the cable.

Run by a test as `bridge_hosts.py near|far KEYS`, with 10.77.0.1 near and 10.77.0.2 far. Each host has a router.
"""

import subprocess
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path

from bridge_recordings import horizon
from bridge_toys import wait_until

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.inbox import Inbox
from bridge.messages import FallHorizon
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON
from bridge.transport.zenoh import ZenohTransport, open_session

HERE = {"near": "controller", "far": "anticipation"}
CLOCK = SystemClock()


def config(name: str, keys: Path) -> BridgeConfig:
    roles = dict.fromkeys(("perception", "anticipation", "controller", "drive"), "")
    roles[HERE[name]] = "tls/127.0.0.1:7471"
    local = "tls/127.0.0.1:7470"
    router = {"listen": [local, "tls/10.77.0.1:7470"]} if name == "near" else {"listen": [local]}
    if name == "far":
        router["connect"] = ["tls/10.77.0.1:7470"]
    return BridgeConfig.model_validate(
        {"keys": str(keys), "endpoints": roles, "connect": [local], "router": router},
    )


def foresee(wire: ZenohTransport) -> None:
    outbox = Outbox(wire, FALL_HORIZON)
    while True:
        outbox.send(horizon(CLOCK.now_ns()))
        time.sleep(0.03)


def listen(wire: ZenohTransport) -> None:
    inbox = Inbox[FallHorizon](wire, FALL_HORIZON)
    cable = ["ip", "link", "set", "near0"]

    def heard() -> bool:
        return inbox.read(CLOCK.now_ns()).ok

    wait_until(heard, "the horizon is heard")
    print("heard", flush=True)
    subprocess.run([*cable, "down"], check=True)
    wait_until(lambda: "ms old, limit 150" in inbox.read(CLOCK.now_ns()).fault, "the horizon is stale")
    print("stale", flush=True)
    time.sleep(1.0)  # longer than the lease: both ends have given the link up
    subprocess.run([*cable, "up"], check=True)
    wait_until(heard, "the horizon is heard again")
    print("heard", flush=True)


if __name__ == "__main__":
    name, keys = sys.argv[1], Path(sys.argv[2])
    made = config(name, keys)
    with ExitStack() as stack:
        stack.enter_context(closing(open_session(made, "router")))
        wire = stack.enter_context(closing(ZenohTransport(made, HERE[name], CLOCK)))
        (foresee if name == "far" else listen)(wire)
