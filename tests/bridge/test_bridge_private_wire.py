"""Runs of their own: a namespace, free ports and no router, by TLS where certificates are in use."""

from __future__ import annotations

import socket
from contextlib import closing
from pathlib import Path

from bridge_site import make_keys

from bridge.clock import SystemClock
from bridge.config.bridge import is_loopback
from bridge.config.load import load_config
from bridge.latency.system import LiveSystem
from bridge.launch.private import private_wire
from bridge.transport.zenoh import ZenohTransport

ROLES = ("perception", "anticipation", "controller", "drive")


def test_it_shares_nothing_with_the_robot() -> None:
    robot = ["bridge.mode=client", "bridge.connect=['tcp/127.0.0.1:7470']", "bridge.endpoints.drive=''"]
    usual = load_config(None, robot).bridge
    own = load_config(None, [*robot, *private_wire(None, robot, ROLES, "t")]).bridge
    assert own.namespace != usual.namespace
    assert own.connect == ()
    assert own.mode == "peer"
    assert set(own.endpoints) == set(ROLES), "a role that is elsewhere for the robot is here for this run"
    assert not set(own.endpoints.values()) & set(usual.endpoints.values())
    assert len(set(own.endpoints.values())) == 4
    assert all(endpoint.startswith("tcp/") and is_loopback(endpoint) for endpoint in own.endpoints.values())


def test_a_port_in_use_is_not_taken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as busy:
        taken = f"tcp/127.0.0.1:{busy.getsockname()[1]}"
        overrides = [f"bridge.endpoints.controller={taken}"]
        loaded = load_config(None, [*overrides, *private_wire(None, overrides, ROLES, "t")])
    assert taken not in loaded.bridge.endpoints.values()


def test_with_certificates_it_is_tls_and_a_session_opens(tmp_path: Path) -> None:
    make_keys(tmp_path / "keys")
    overrides = [f"bridge.keys={tmp_path / 'keys'}"]
    loaded = load_config(None, [*overrides, *private_wire(None, overrides, ROLES, "t")]).bridge
    assert all(endpoint.startswith("tls/127.0.0.1:") for endpoint in loaded.endpoints.values())
    with closing(ZenohTransport(loaded, "drive", SystemClock())):
        host, port = loaded.endpoints["drive"].removeprefix("tls/").split(":")
        with socket.create_connection((host, int(port)), timeout=5.0):
            pass


def test_latency_can_be_measured_with_certificates(tmp_path: Path) -> None:
    """Its observer opens, where it was refused for an endpoint at which nobody shows a certificate."""
    make_keys(tmp_path / "keys")
    with LiveSystem(1.0, None, [f"bridge.keys={tmp_path / 'keys'}"], "log") as system:
        assert system.launcher.poll().keys() == set(ROLES)
