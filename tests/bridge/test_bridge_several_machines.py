"""Perception's side on one host, the controller on another, routers between them, and a network that misbehaves.

The hosts are loopback addresses here, and network namespaces where the kernel grants them.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from bridge_network import Relay
from bridge_recordings import horizon
from bridge_site import QUIET, Feed, Node, Statuses, make_keys
from bridge_toys import free_ports, listening, wait_until

from bridge.cli import main
from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.config.load import load_config
from bridge.inbox import Inbox
from bridge.messages import FallHorizon, Wrench
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON, WRENCH
from bridge.transport.zenoh import ZenohTransport, open_session

REPO = Path(__file__).resolve().parents[2]
CAMERA, WALKER = "127.0.0.3", "127.0.0.2"

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]


def documented(name: str) -> str:
    """Return the configuration of a machine as docs/several-machines.md gives it."""
    page = (REPO / "docs" / "several-machines.md").read_text(encoding="utf-8")
    found = re.search(rf"`{name}`:\n\n\s*```toml\n(.*?)```", page, re.DOTALL)
    assert found, f"{name} is not in the docs"
    return found.group(1)


class TwoHosts:
    """Two routers and a controller as processes, configured as documented; a relay is the cable between the hosts."""

    def __init__(self, folder: Path) -> None:
        self._stack = ExitStack()
        keys = folder / "keys"
        make_keys(keys, [CAMERA, WALKER])
        camera, walker, outside, *ports = free_ports(7)
        self.relay = Relay((WALKER, outside))
        self.files = {"camera": folder / "camera.toml", "walker": folder / "walker.toml"}
        for name, local in (("camera", camera), ("walker", walker)):
            text = documented(f"{name}.toml").replace('keys = "keys"', f'keys = "{keys}"')
            text = text.replace("127.0.0.1:7470", f"{CAMERA if name == 'camera' else WALKER}:{local}")
            elsewhere = self.relay.address if name == "camera" else f"{WALKER}:{outside}"
            self.files[name].write_text(text.replace("10.0.0.3:7470", elsewhere))
        roles = dict(zip(("perception", "anticipation", "controller", "drive"), ports, strict=True))
        self.overrides = {
            name: [*QUIET, *(f"bridge.endpoints.{role}=tls/{host}:{roles[role]}" for role in here)]
            for name, host, here in (
                ("camera", CAMERA, ("perception", "anticipation")),
                ("walker", WALKER, ("controller", "drive")),
            )
        }
        config = {name: load_config(file, self.overrides[name]).bridge for name, file in self.files.items()}
        with self._stack:
            self._stack.enter_context(closing(self.relay))
            self.routers = {name: self._stack.enter_context(closing(self.router(name))) for name in self.files}
            words = ["--config", str(self.files["walker"]), "--option", "controller=log"]
            words += [word for pair in self.overrides["walker"] for word in ("--set", pair)]
            self.controller = self._stack.enter_context(
                closing(Node("controller.node", folder / "controller.log", words))
            )
            self.feed = self._stack.enter_context(closing(Feed(config["camera"], config["walker"])))
            self.statuses = self._stack.enter_context(closing(Statuses(config["walker"])))
            self.far_statuses = self._stack.enter_context(closing(Statuses(config["camera"])))
            self.follows()
            self._stack = self._stack.pop_all()

    def router(self, name: str) -> Node:
        file = self.files[name]
        return Node("bridge.cli", file.with_suffix(".log"), ["router", "--config", str(file)])

    def age_ms(self) -> float:
        return float(self.statuses.value("age_ms.horizon"))

    def follows(self) -> None:
        wait_until(lambda: self.statuses.value("state") == "FOLLOW", "the controller follows")

    def stops(self) -> str:
        """Wait until the controller stops; return why."""
        wait_until(lambda: self.statuses.value("state") == "SAFE_STOP", "the controller stops")
        return self.statuses.value("reason")

    def close(self) -> None:
        self._stack.close()


@pytest.fixture(scope="module")
def hosts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoHosts]:
    with closing(TwoHosts(tmp_path_factory.mktemp("hosts"))) as made:
        yield made


def test_the_horizon_comes_through_the_routers_alone(hosts: TwoHosts) -> None:
    hosts.follows()
    before = hosts.relay.carried
    sent = hosts.feed.sent(FALL_HORIZON)
    wait_until(lambda: hosts.feed.sent(FALL_HORIZON) > sent + 30, "thirty more horizons")
    assert hosts.relay.carried - before > 30 * 1000, "they went through the cable"
    wait_until(lambda: hosts.far_statuses.value("state") == "FOLLOW", "the other host sees the controller")
    for name, router in hosts.routers.items():
        wait_until(lambda router=router: "connected: router at" in router.said, f"{name}'s router knows the other")


@pytest.mark.parametrize("trouble", ["partition", "routers gone"])
def test_a_partition_stops_the_walker_and_healing_is_enough(hosts: TwoHosts, trouble: str) -> None:
    hosts.follows()
    if trouble == "partition":
        hosts.relay.swallow = True
    else:
        hosts.routers["camera"].close()
    reason = hosts.stops()
    assert "horizon" in reason
    assert re.search(r"\d+ ms old, limit 150", reason)
    assert float(hosts.statuses.value("age_ms.wrench")) < 1000.0, "what is on the walker goes on"
    if trouble == "partition":
        hosts.relay.swallow = False
    else:
        hosts.routers["camera"] = hosts._stack.enter_context(closing(hosts.router("camera")))
    hosts.follows()


def test_broken_connections_are_made_again(hosts: TwoHosts) -> None:
    hosts.follows()
    accepted = hosts.feed.sent(FALL_HORIZON)
    for _ in range(3):
        hosts.relay.cut()
        carried = hosts.relay.carried
        wait_until(lambda carried=carried: hosts.relay.carried > carried + 50_000, "the link is back")
    hosts.follows()
    assert hosts.feed.sent(FALL_HORIZON) > accepted


def test_delay_is_seen_as_age_and_too_much_of_it_stops(hosts: TwoHosts) -> None:
    hosts.follows()
    hosts.relay.delay_s = 0.06
    wait_until(lambda: hosts.age_ms() >= 60.0, "the horizon is older by the delay")
    hosts.relay.delay_s = 0.25
    assert re.search(r"ms old, limit 150", hosts.stops())
    hosts.relay.delay_s = 0.0
    hosts.follows()


def test_loss_is_lateness_and_never_a_wrong_order(hosts: TwoHosts) -> None:
    hosts.follows()
    hosts.statuses.seen.clear()
    before = hosts.relay.lost
    hosts.relay.loss = 0.1
    wait_until(lambda: hosts.relay.lost >= before + 6, "some packets are lost")
    hosts.relay.loss = 0.0
    hosts.follows()
    seen = {status.values["state"] for status in hosts.statuses.seen}
    assert seen <= {"FOLLOW", "GUARD", "SAFE_STOP", "RECOVER"}
    assert "old message" not in hosts.controller.said


def peer(role: str, port: int, router: str) -> BridgeConfig:
    here = dict.fromkeys(("perception", "anticipation", "controller", "drive"), "")
    return BridgeConfig(endpoints={**here, role: f"tcp/{WALKER}:{port}"}, connect=(router,))


def test_one_router_joins_a_client_and_peers() -> None:
    """Anticipation as a client on one host, controller and drive as peers on the other; the router comes and goes."""
    router_port, controller_port, drive_port = free_ports(3)
    router = f"tcp/{WALKER}:{router_port}"
    routing = BridgeConfig(router={"listen": [router]})  # type: ignore[arg-type]
    clock = SystemClock()
    with ExitStack() as stack:
        first = open_session(routing, "router")
        client = BridgeConfig(mode="client", connect=(router,))
        far = stack.enter_context(closing(ZenohTransport(client, "anticipation", clock)))
        controller = stack.enter_context(
            closing(ZenohTransport(peer("controller", controller_port, router), "controller", clock))
        )
        drive_config = peer("drive", drive_port, router)
        with_controller = {**drive_config.endpoints, "controller": f"tcp/{WALKER}:{controller_port}"}
        drive_config = drive_config.model_copy(update={"endpoints": dict(reversed(with_controller.items()))})
        drive = stack.enter_context(closing(ZenohTransport(drive_config, "drive", clock)))
        foreseen, pushed = Outbox(far, FALL_HORIZON), Outbox(drive, WRENCH)
        horizons = Inbox[FallHorizon](controller, FALL_HORIZON)
        wrenches = [Inbox[Wrench](end, WRENCH) for end in (controller, far)]
        alive: dict[str, bool] = {}
        far.watch_alive(alive.__setitem__)
        controller.declare_alive("controller")

        def heard() -> bool:
            now_ns = clock.now_ns()
            foreseen.send(horizon(now_ns))
            pushed.send(Wrench(stamp_ns=now_ns, force=[1, 0, 0], torque=[0, 0, 0]))
            return horizons.read(now_ns).fresh and all(inbox.read(now_ns).fresh for inbox in wrenches)

        wait_until(heard, "both ways through the router")
        wait_until(lambda: alive.get("controller") is True, "the far side sees the controller")
        assert wrenches[0].refused == 0, "nothing comes twice, by the router and by the link between peers"
        first.close()
        wait_until(lambda: alive["controller"] is False, "the far side misses the controller")
        with closing(open_session(routing, "router")):
            wait_until(heard, "both ways through the new router")
            wait_until(lambda: alive["controller"] is True, "the far side sees the controller again")


def test_a_router_whose_port_is_taken_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_ports(1)[0]
    with listening(port):
        assert main(["router", "--set", f"bridge.router.listen=['tcp/127.0.0.1:{port}']"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"router cannot listen on tcp/127.0.0.1:{port}: the port is in use" in error
    assert "bridge.router.listen" in error


NAMESPACES = """
set -e
mount -t tmpfs none /run
ip link set lo up
ip netns add far
ip link add near0 type veth peer name far0
ip link set far0 netns far
ip addr add 10.77.0.1/24 dev near0
ip link set near0 up
ip -n far addr add 10.77.0.2/24 dev far0
ip -n far link set far0 up
ip -n far link set lo up
"""


def in_namespaces(script: str, *arguments: str) -> list[str]:
    return ["unshare", "-rnm", "bash", "-c", NAMESPACES + script, "bash", *arguments]


def granted() -> bool:
    try:
        return subprocess.run(in_namespaces(":"), capture_output=True, timeout=30, check=False).returncode == 0
    except OSError:
        return False


def test_two_network_namespaces_and_a_link_that_goes_down(tmp_path: Path) -> None:
    if not granted():
        pytest.skip("network namespaces are not granted here (unshare -rnm, ip)")
    make_keys(tmp_path / "keys", ["10.77.0.1", "10.77.0.2"])
    script = 'ip netns exec far "$1" "$2" far "$3" & "$1" "$2" near "$3"; kill %1; wait'
    hosts = REPO / "tests" / "bridge" / "bridge_hosts.py"
    done = subprocess.run(
        in_namespaces(script, sys.executable, str(hosts), str(tmp_path / "keys")),
        capture_output=True,
        timeout=240,
        text=True,
        check=False,
        cwd=REPO,
    )
    assert done.stdout.split() == ["heard", "stale", "heard"], done.stdout + done.stderr


def test_the_relay_delays_and_swallows() -> None:
    """What the tests above rest on."""
    import socket
    import time

    with socket.create_server(("127.0.0.1", 0)) as server, closing(Relay(server.getsockname())) as relay:
        host, _, port = relay.address.partition(":")
        with socket.create_connection((host, int(port))) as near:
            far, _ = server.accept()
            with far:
                far.settimeout(5.0)
                relay.delay_s = 0.1
                began_s = time.monotonic()
                near.sendall(b"late")
                assert far.recv(16) == b"late"
                assert time.monotonic() - began_s >= 0.1
                relay.delay_s, relay.swallow = 0.0, True
                near.sendall(b"lost in time")
                far.settimeout(0.2)
                with pytest.raises(TimeoutError):
                    far.recv(16)
                relay.swallow = False
                far.settimeout(5.0)
                assert far.recv(16) == b"lost in time"
                relay.cut()
                assert far.recv(16) == b""
