"""With `naming = "rmw_zenoh"` the processes are what rmw_zenoh's own nodes expect of each other.

Expectations are what others saw on the wire of rmw_zenoh 0.10 (`ros2 topic pub /chatter`, captured by a client
written in Go) and the examples of ros2/rmw_zenoh's `docs/design.md` (Jazzy); type hashes as `ros2 topic info
--verbose` prints them.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import Any

import numpy as np
import pytest
import zenoh
from bridge_recordings import command
from bridge_toys import free_ports, wait_until

from bridge.clock import SystemClock
from bridge.codec import TYPES, encode
from bridge.config.bridge import BridgeConfig
from bridge.inbox import Inbox
from bridge.messages import Wrench
from bridge.outbox import Outbox
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, TOPICS, TWIST, WRENCH
from bridge.transport.attachment import pack, unpack
from bridge.transport.names import RmwZenohNames, type_hash
from bridge.transport.rmw_zenoh import Endpoint, NodeName, Qos, data_key, identifier, qos_part, type_name
from bridge.transport.zenoh import ZenohTransport

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CAPTURED_NODE = NodeName(0, "cb6e75cf8194a4d81370b618e0a4ed07", "/", "_ros2cli_413596")
CAPTURED_TOKEN = (
    "@ros2_lv/0/cb6e75cf8194a4d81370b618e0a4ed07/0/4/MP/%/%/_ros2cli_413596/"
    f"%chatter/std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,"
)
CAPTURED_ATTACHMENT = bytes.fromhex("1b0000000000000040a1c53a897cc618101236acd8c8370ad4e6ed96c021a8b85e")


def test_the_key_of_a_topic_is_the_design_documents() -> None:
    assert data_key(0, "/chatter", STRING, STRING_HASH) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert data_key(7, "/robot1/chatter", STRING, "H").startswith("7/robot1/chatter/")


def test_the_token_of_a_publisher_is_the_captured_one() -> None:
    made = CAPTURED_NODE.endpoint_token(4, Endpoint.PUBLISHER, "/chatter", STRING, STRING_HASH, Qos(depth=10))
    assert made == CAPTURED_TOKEN


def test_tokens_of_the_design_document() -> None:
    listener = NodeName(0, "aac3178e146ba6f1fc6e6a4085e77f21", "/", "listener")
    talker = NodeName(0, "8b20917502ee955ac4476e0266340d5c", "/", "talker")
    topic = f"%chatter/{type_name(STRING)}/{STRING_HASH}"
    assert listener.token() == "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
    assert listener.endpoint_token(10, Endpoint.SUBSCRIPTION, "/chatter", STRING, STRING_HASH, Qos(depth=10)) == (
        f"@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/{topic}/::,10:,:,:,,"
    )
    assert talker.endpoint_token(10, Endpoint.PUBLISHER, "/chatter", STRING, STRING_HASH, Qos(depth=7)) == (
        f"@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/{topic}/::,7:,:,:,,"
    )


@pytest.mark.parametrize(
    ("qos", "part"),
    [(Qos(depth=10), "::,10:,:,:,,"), (Qos(2, 2, 1, 5), "2::,5:,:,:,,"), (Qos(1, 1, 1, 1), ":1:,1:,:,:,,")],
    ids=["default profile", "sensor data", "transient local"],
)
def test_quality_of_service_as_captured(qos: Qos, part: str) -> None:
    assert qos_part(qos) == part


def test_the_identifier_of_a_publisher_follows_from_its_token() -> None:
    """What the captured publisher attached to its samples is the hash of the token captured beside it."""
    sequence, source = unpack(CAPTURED_ATTACHMENT)
    assert source == identifier(CAPTURED_TOKEN)
    assert sequence == 0x1B
    assert pack(0x1B, 0x18C67C893AC5A140, source) == CAPTURED_ATTACHMENT


def test_the_attachment_is_what_zenohs_own_serializer_writes() -> None:
    source = bytes(range(16))
    parts = (zenoh.ext.Int64(7), zenoh.ext.Int64(1_234_567_890_123), source)
    assert pack(7, 1_234_567_890_123, source) == zenoh.ext.z_serialize(parts).to_bytes()


@pytest.mark.parametrize("damage", [b"", b"short", CAPTURED_ATTACHMENT[:-1], CAPTURED_ATTACHMENT[:16] + b"\x11" * 17])
def test_another_attachment_names_no_publisher(damage: bytes) -> None:
    assert unpack(damage) == (-1, b"")


@pytest.mark.parametrize(
    ("ros_type", "expected"),
    [
        (STRING, STRING_HASH),
        (WRENCH.ros_type, "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"),
        (ODOMETRY.ros_type, "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        (TWIST.ros_type, "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"),
        (DIAGNOSTICS.ros_type, "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"),
    ],
)
def test_type_hashes_are_those_of_ros2(ros_type: str, expected: str) -> None:
    assert type_hash(ros_type) == expected


def test_a_changed_definition_changes_the_key() -> None:
    names = RmwZenohNames("surefoot", 0)
    assert len({names.key(topic).split("/")[-1] for topic in TOPICS}) == len({topic.ros_type for topic in TOPICS})
    for topic in (KEYPOINTS, FALL_HORIZON, SUPPORT_COMMAND):
        assert names.key(topic) == (
            f"0/surefoot/{topic.key}/surefoot_msgs::msg::dds_::{topic.message.__name__}_/{TYPES.hash_rihs01(topic.ros_type)}"
        )


class Ros2:
    """A session on the same wire that knows nothing of Surefoot, as a ROS 2 node's is."""

    def __init__(self, endpoint: str) -> None:
        settings = zenoh.Config()
        for path, value in {
            "connect/endpoints": [endpoint],
            "listen/endpoints": [],
            "scouting/multicast/enabled": False,
        }.items():
            settings.insert_json5(path, json.dumps(value))
        self.session: Any = zenoh.open(settings)
        self.graph: set[str] = set()
        self._watch = self.session.liveliness().declare_subscriber(
            "@ros2_lv/3/**", zenoh.handlers.Callback(self._note, indirect=False), history=True
        )

    def _note(self, sample: Any) -> None:
        (self.graph.add if sample.kind == zenoh.SampleKind.PUT else self.graph.discard)(str(sample.key_expr))

    def close(self) -> None:
        self._watch.undeclare()
        self.session.close()


class Wired:
    """A controller that speaks rmw_zenoh's names in domain 3, and a ROS 2 node beside it."""

    def __init__(self, stack: ExitStack) -> None:
        endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
        config = BridgeConfig(naming="rmw_zenoh", domain=3, namespace="lab/walker", endpoints={"controller": endpoint})
        self.clock = SystemClock()
        self.transport = stack.enter_context(closing(ZenohTransport(config, "controller", self.clock)))
        self.ros2 = stack.enter_context(closing(Ros2(endpoint)))

    def graph(self, kind: str) -> list[list[str]]:
        """Return the parts of the tokens of one kind, from the node's number on."""
        return sorted(token.split("/")[3:] for token in self.ros2.graph if f"/{kind}/" in token)


@pytest.fixture
def wired() -> Iterator[Wired]:
    with ExitStack() as stack:
        yield Wired(stack)


def test_ros2_sees_the_node_and_its_topics(wired: Wired) -> None:
    session = str(wired.transport.session.info.zid())
    outbox, inbox = Outbox(wired.transport, SUPPORT_COMMAND), Inbox[Wrench](wired.transport, WRENCH)
    wait_until(lambda: len(wired.ros2.graph) == 3, "node, publisher and subscription are in the graph")
    assert f"@ros2_lv/3/{session}/0/0/NN/%/%lab%walker/controller" in wired.ros2.graph
    (publisher,) = wired.graph("MP")
    assert publisher[1:6] == ["1", "MP", "%", "%lab%walker", "controller"]
    assert publisher[6:] == [
        "%lab%walker%support_command",
        "surefoot_msgs::msg::dds_::SupportCommand_",
        type_hash(SUPPORT_COMMAND.ros_type),
        "::,10:,:,:,,",
    ]
    (subscription,) = wired.graph("MS")
    assert subscription[1:3] == ["2", "MS"]
    outbox.close()
    inbox.close()
    wait_until(lambda: len(wired.ros2.graph) == 1, "what is closed leaves the graph")


def test_ros2_receives_what_is_published(wired: Wired) -> None:
    key = (
        f"3/lab/walker/support_command/surefoot_msgs::msg::dds_::SupportCommand_/{type_hash(SUPPORT_COMMAND.ros_type)}"
    )
    got: list[tuple[bytes, bytes]] = []
    arrived = threading.Event()

    def receive(sample: Any) -> None:
        got.append((sample.payload.to_bytes(), sample.attachment.to_bytes()))
        arrived.set()

    subscriber = wired.ros2.session.declare_subscriber(key, zenoh.handlers.Callback(receive, indirect=False))
    outbox = Outbox(wired.transport, SUPPORT_COMMAND)
    message = command(wired.clock.now_ns())
    wait_until(lambda: outbox.send(message) or arrived.is_set(), "a command arrives")
    payload, attachment = got[0]
    raw = TYPES.deserialize_cdr(payload, SUPPORT_COMMAND.ros_type)
    assert raw.state == "FOLLOW"
    wait_until(lambda: wired.graph("MP"), "the publisher is in the graph")
    (token,) = (token for token in wired.ros2.graph if "/MP/" in token)
    sequence, source = unpack(attachment)
    assert source == identifier(token), "samples can be told to come from the publisher in the graph"
    assert attachment[8:16] == message.stamp_ns.to_bytes(8, "little")
    assert sequence == raw.sequence
    subscriber.undeclare()


def test_what_ros2_publishes_is_received(wired: Wired) -> None:
    inbox = Inbox[Wrench](wired.transport, WRENCH)
    publisher = wired.ros2.session.declare_publisher(RmwZenohNames("lab/walker", 3).key(WRENCH))
    source, sequence = bytes(range(16)), 0

    def send() -> bool:
        nonlocal sequence
        sequence += 1
        sent = Wrench(stamp_ns=wired.clock.now_ns(), force=[1, 2, 3], torque=[0, 0, 4])
        publisher.put(encode(WRENCH, sent), attachment=pack(sequence, sent.stamp_ns, source))
        return inbox.read(wired.clock.now_ns()).ok

    wait_until(send, "a wrench from ROS 2 is accepted")
    read = inbox.read(wired.clock.now_ns()).message
    assert read is not None
    assert np.array_equal(read.force, [1, 2, 3])
    publisher.undeclare()


def open_with(**settings: Any) -> Any:
    config = zenoh.Config()
    for path, value in {"scouting/multicast/enabled": False, **settings}.items():
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


@pytest.fixture
def behind_their_router() -> Iterator[tuple[str, Any]]:
    """rmw_zenohd and a ROS 2 node as they come: the node a peer, gossip on, and no brokering between peers."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    router = open_with(
        **{"mode": "router", "listen/endpoints": [endpoint], "routing/router/peers_failover_brokering": False}
    )
    node = open_with(**{"mode": "peer", "connect/endpoints": [endpoint], "listen/endpoints": ["tcp/127.0.0.1:0"]})
    yield endpoint, node
    node.close()
    router.close()


def test_as_clients_of_their_router_both_sides_hear_each_other(behind_their_router: tuple[str, Any]) -> None:
    """As docs/wire.md says; a process in peer mode would hear nothing behind that router."""
    endpoint, node = behind_their_router
    config = BridgeConfig(naming="rmw_zenoh", domain=0, mode="client", connect=(endpoint,))
    clock, names = SystemClock(), RmwZenohNames("surefoot", 0)
    with closing(ZenohTransport(config, "controller", clock)) as transport:
        inbox, outbox = Inbox[Wrench](transport, WRENCH), Outbox(transport, SUPPORT_COMMAND)
        heard = threading.Event()
        subscriber = node.declare_subscriber(
            names.key(SUPPORT_COMMAND), zenoh.handlers.Callback(lambda _: heard.set(), indirect=False)
        )
        publisher = node.declare_publisher(names.key(WRENCH))

        def both() -> bool:
            now_ns = clock.now_ns()
            sent = Wrench(stamp_ns=now_ns, force=[1, 2, 3], torque=[0, 0, 4])
            publisher.put(encode(WRENCH, sent), attachment=pack(now_ns, now_ns, bytes(16)))
            outbox.send(command(now_ns))
            return inbox.read(clock.now_ns()).ok and heard.is_set()

        wait_until(both, "a wrench comes in and a command goes out")
        subscriber.undeclare()


def test_robots_in_other_domains_are_not_heard(wired: Wired) -> None:
    inbox = Inbox[Wrench](wired.transport, WRENCH)
    ours, other = (
        wired.ros2.session.declare_publisher(RmwZenohNames("lab/walker", domain).key(WRENCH)) for domain in (3, 4)
    )
    source = bytes(range(16))

    def send() -> bool:
        for publisher, force in ((other, 666.0), (ours, 1.0)):
            sent = Wrench(stamp_ns=wired.clock.now_ns(), force=[force, 0, 0], torque=[0, 0, 0])
            publisher.put(encode(WRENCH, sent), attachment=pack(sent.stamp_ns, sent.stamp_ns, source))
            read = inbox.read(wired.clock.now_ns()).message
            assert read is None or read.force[0] == 1.0
        return inbox.accepted > 3

    wait_until(send, "wrenches of our own domain are accepted")
