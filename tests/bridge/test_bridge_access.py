"""Who may say what, as rules; what Zenoh says it turned away, as lines of our log."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Literal

import pytest
import zenoh
from bridge_site import make_keys
from bridge_toys import free_ports, wait_until

from bridge.clock import SystemClock
from bridge.config.bridge import BridgeConfig
from bridge.keys.identity import IDENTITIES, OBSERVER, PUBLISHERS, ROUTER
from bridge.refusals import Refusals
from bridge.topics import DIAGNOSTICS, TOPICS, WRENCH, Topic
from bridge.transport.access import access_control
from bridge.transport.interface import Sample
from bridge.transport.names import Names, names_of
from bridge.transport.wire_log import Digest
from bridge.transport.zenoh import ZenohTransport

Naming = Literal["ros2dds", "rmw_zenoh"]


class Rules:
    """Zenoh's decision by the rules, made by its own notion of inclusion."""

    def __init__(self, naming: Naming) -> None:
        self.names: Names = names_of(BridgeConfig(naming=naming))
        self.rules: dict[str, Any] = access_control(self.names)
        self._by_id = {rule["id"]: rule for rule in self.rules["rules"]}

    def allows(self, identity: str, message: str, key: str, flow: str = "ingress") -> bool:
        subjects = {entry["id"] for entry in self.rules["subjects"] if identity in entry["cert_common_names"]}
        for policy in self.rules["policies"]:
            if not subjects & set(policy["subjects"]):
                continue
            for name in policy["rules"]:
                rule = self._by_id[name]
                assert rule["permission"] == "allow"
                included = any(zenoh.KeyExpr(allowed).includes(zenoh.KeyExpr(key)) for allowed in rule["key_exprs"])
                if included and flow in rule["flows"] and message in rule["messages"]:
                    return True
        return False


@pytest.fixture(params=["ros2dds", "rmw_zenoh"])
def rules(request: pytest.FixtureRequest) -> Rules:
    return Rules(request.param)


def may_write(identity: str, topic: Topic) -> bool:
    return identity in (ROUTER, topic.publisher) or (topic == DIAGNOSTICS and identity in PUBLISHERS)


def test_what_is_not_allowed_is_denied(rules: Rules) -> None:
    assert rules.rules["enabled"] is True
    assert rules.rules["default_permission"] == "deny"


def test_every_role_writes_its_own_topics_alone(rules: Rules) -> None:
    for identity in (*IDENTITIES, "stranger"):
        for topic in TOPICS:
            assert rules.allows(identity, "put", rules.names.key(topic)) == may_write(identity, topic), (
                identity,
                topic,
            )
            assert not rules.allows(identity, "delete", rules.names.key(topic))
    assert sum(rules.allows(OBSERVER, "put", rules.names.key(topic)) for topic in TOPICS) == 0


def test_every_role_claims_its_own_life_alone(rules: Rules) -> None:
    for identity in (*IDENTITIES, "stranger"):
        for role in PUBLISHERS:
            allowed = rules.allows(identity, "liveliness_token", rules.names.alive(role))
            assert allowed == (identity in (role, ROUTER))


def test_everybody_with_a_role_reads(rules: Rules) -> None:
    for identity in (*IDENTITIES, "stranger"):
        for topic in TOPICS:
            known = identity in IDENTITIES
            assert rules.allows(identity, "declare_subscriber", rules.names.key(topic)) == known
            assert rules.allows(identity, "put", rules.names.key(topic), "egress") == known
        assert rules.allows(identity, "declare_liveliness_subscriber", rules.names.alive("*")) == known


def test_another_robot_and_the_whole_world_are_out_of_reach(rules: Rules) -> None:
    for identity in IDENTITIES:
        for key in ("other/keypoints", "**", "1/surefoot/keypoints/x/y", "@/**"):
            for message in ("put", "declare_subscriber", "liveliness_token", "query", "declare_queryable", "reply"):
                assert not rules.allows(identity, message, key), (identity, message, key)


def test_nodes_show_themselves_to_ros2_and_nobody_else() -> None:
    rules = Rules("rmw_zenoh")
    for identity in IDENTITIES:
        for role in PUBLISHERS:
            node = rules.names.node("ab12", role)
            assert node is not None
            allowed = rules.allows(identity, "liveliness_token", node.token())
            assert allowed == (identity in (role, OBSERVER, ROUTER))  # an observer's node may have any name


@pytest.mark.parametrize("naming", ["ros2dds", "rmw_zenoh"])
def test_the_rules_let_the_system_work(tmp_path: Path, naming: Naming) -> None:
    """Certificates, rules and both namings on a real wire: topics, lives and, for ROS 2, the graph."""
    make_keys(tmp_path / "keys")
    ports = dict(zip(("perception", "anticipation", "controller", "drive"), free_ports(4), strict=True))
    endpoints = {role: f"tls/127.0.0.1:{port}" for role, port in ports.items()}
    config = BridgeConfig(keys=str(tmp_path / "keys"), endpoints=endpoints, naming=naming)
    clock, graph = SystemClock(), set[str]()
    with ExitStack() as stack:
        drive, controller, viewer = (
            stack.enter_context(closing(ZenohTransport(config, role, clock)))
            for role in ("drive", "controller", "view")
        )
        heard: dict[str, list[Sample]] = {"controller": [], "view": []}
        for transport, role in ((controller, "controller"), (viewer, "view")):
            transport.subscribe(WRENCH, heard[role].append)
        alive: dict[str, bool] = {}
        viewer.watch_alive(alive.__setitem__)
        ros2 = viewer.session.liveliness().declare_subscriber(
            "@ros2_lv/0/**", lambda sample: graph.add(str(sample.key_expr)), history=True
        )
        controller.declare_alive("controller")
        publisher = drive.publisher(WRENCH)
        wait_until(lambda: publisher.put(b"x", 0) or all(heard.values()), "both hear the drive")
        wait_until(lambda: alive.get("controller") is True, "the viewer sees that the controller lives")
        if naming == "rmw_zenoh":
            wait_until(lambda: sum("/MS/" in token for token in graph) == 2, "both subscriptions are in the graph")
            wait_until(lambda: sum("/MP/" in token for token in graph) == 1, "and the publisher")
            assert sum("/NN/" in token for token in graph) == 3
        else:
            assert graph == set()
        ros2.undeclare()


# what Zenoh 1.10 writes
STAMP = b"2026-11-22T11:39:29.446661Z"
TRACE = b" rx-0 ThreadId(12) zenoh::net::routing::interceptor::access_control: "
ZID = b"6e888924fd4c3df3068bde2e64444739"
SUBJECT = ZID + b" on Interface(lo)+CertCommonName(perception)+Transport(Tls)+" + ZID
CACHED = STAMP + b" TRACE" + TRACE + b"Using cached result: " + ZID
DENIED = CACHED + b" is unauthorized to Put (ingress) on surefoot/fall_horizon\n"
FILLING = b"".join(
    STAMP + b" TRACE" + TRACE + SUBJECT + b" is unauthorized to " + what + b" (ingress) on surefoot/fall_horizon\n"
    for what in (b"Query", b"Reply", b"Put", b"Delete", b"Declare/Undeclare Queryable", b"Liveliness Query")
)
CLAIM = (
    STAMP + b" TRACE" + TRACE + SUBJECT + b" is unauthorized to Liveliness Token (ingress) on surefoot/alive/drive\n"
)
HINT = b". Hint: increase the system open file limit.\n"
HANDSHAKE = STAMP + b"  WARN acc-0 ThreadId(05) zenoh_link_tls::unicast: peer sent no certificates" + HINT
COLOURED = (
    b"\x1b[2m"
    + STAMP
    + b"\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(05) \x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:"
    b"\x1b[0m invalid peer certificate: UnknownIssuer" + HINT
)
CONNECT = STAMP + b" DEBUG net-0 ThreadId(03) zenoh::net::runtime::orchestrator: Unable to connect to configured peer "
FALSE_SERVER = CONNECT + (
    b"tls/127.0.0.1:7701! Can not create a new TLS link bound to IpAddress(V4(Ipv4Addr([127, 0, 0, 1]))): invalid peer "
    b"certificate: UnknownIssuer at /root/.cargo/git/checkouts/zenoh/io/zenoh-link-tls/src/unicast.rs:226.. Retry\n"
)
NOBODY_THERE = CONNECT + b"tls/127.0.0.1:7702! Connection refused (os error 111) at /root/.cargo/unicast.rs:1.. Retry\n"


def said(*parts: bytes) -> list[str]:
    lines: list[str] = []
    digest = Digest(Refusals(lines.append))
    for part in parts:
        digest.take(part, 0.0)
    return lines


def test_denials_are_named_by_certificate() -> None:
    assert said(FILLING, DENIED * 3, CLAIM) == [
        "refused: perception may not put surefoot/fall_horizon (3 times)",
        "refused: perception may not claim surefoot/alive/drive",
    ]


def test_what_is_allowed_or_only_looked_up_is_not_said() -> None:
    allowed = CACHED + b" is authorized to Put (ingress) on surefoot/keypoints\n"
    outward = CACHED + b" is unauthorized to Put (egress) on surefoot/keypoints\n"
    assert said(FILLING, allowed * 50, outward, NOBODY_THERE) == []


def test_who_is_not_let_in_is_said() -> None:
    assert said(HANDSHAKE * 2, COLOURED, FALSE_SERVER) == [
        "refused: a connection: peer sent no certificates (2 times)",
        "refused: a connection: invalid peer certificate: UnknownIssuer",
        "refused: to connect to tls/127.0.0.1:7701: invalid peer certificate: UnknownIssuer",
    ]


def test_a_flood_of_denials_is_counted_whole() -> None:
    assert said(FILLING, DENIED * 5000) == ["refused: perception may not put surefoot/fall_horizon (5000 times)"]


@pytest.mark.parametrize("cut", range(0, 300, 37))
def test_lines_cut_anywhere_are_survived(cut: int) -> None:
    said((FILLING + DENIED + HANDSHAKE + FALSE_SERVER)[cut : -cut or None])


@pytest.mark.processes
def test_what_python_prints_still_goes_where_it_went() -> None:
    script = textwrap.dedent("""
        import logging, os, sys
        from bridge.transport.wire_log import WireLog
        logging.basicConfig(stream=sys.stderr, format="%(message)s")
        print("before", flush=True)
        with WireLog(logging.getLogger("wire")):
            print("within", flush=True)
            os.write(1, b"x zenoh_link_tls::unicast: peer sent no certificates. Hint: none\\n")
        print("after", flush=True)
    """)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == ["before", "within", "after"]
    assert done.stderr == "refused: a connection: peer sent no certificates\n"
