"""What Surefoot writes is read by parties that did not write it: other libraries, other definitions."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import zenoh
from bridge_idl import (
    DiagnosticArrayIdl,
    FallHorizonIdl,
    KeypointsIdl,
    OdometryIdl,
    SupportCommandIdl,
    TwistStampedIdl,
    WrenchStampedIdl,
)
from bridge_recordings import START_NS, Event, walk, write
from bridge_toys import free_ports
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from bridge.clock import SystemClock
from bridge.codec import TYPES as STORE
from bridge.codec import encode
from bridge.config.bridge import BridgeConfig
from bridge.outbox import Outbox
from bridge.record.layout import header_stamp_ns
from bridge.record.reader import Recording
from bridge.topics import TOPICS, Topic
from bridge.transport.interface import Sample
from bridge.transport.zenoh import ZenohTransport

EVENTS = walk(1.5)
COUNTS = {f"/surefoot/{topic.key}": sum(event.topic == topic for event in EVENTS) for topic in TOPICS}
TYPES = {f"/surefoot/{topic.key}": topic.ros_type for topic in TOPICS}


@pytest.fixture(scope="module", params=["walk.mcap", "walk"])
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("bag") / request.param, EVENTS)


def first(topic: str) -> Event:
    return next(event for event in EVENTS if f"/surefoot/{event.topic.key}" == topic)


def check_values(topic: str, raw: Any) -> None:
    """Compare the first message of a topic, as some library decoded it, with what was sent."""
    event = first(topic)
    sent: Any = event.message
    if topic == "/surefoot/diagnostics":
        assert raw.status[0].hardware_id == sent.role
        assert [(pair.key, pair.value) for pair in raw.status[0].values] == list(sent.values.items())
        return
    assert raw.header.stamp.sec * 10**9 + raw.header.stamp.nanosec == sent.stamp_ns
    assert raw.header.frame_id == sent.frame_id
    match event.topic.key:
        case "keypoints" | "detections":
            assert np.array_equal(np.reshape(raw.position_px, (12, 2)), sent.position_px)
            assert list(raw.status) == sent.status.tolist()
            assert (raw.image_width, raw.people, raw.body_length_px) == (320, 1, 150.0)
        case "fall_horizon":
            assert np.array_equal(np.reshape(raw.forecast_px, (16, 12, 2)), sent.forecast_px)
            assert np.array_equal(np.reshape(raw.probabilities, (16, 3)), sent.probabilities)
            assert np.isinf(np.asarray(raw.time_to_boundary)).all()
        case "support_command":
            assert (raw.state, raw.solver, raw.column_height) == ("FOLLOW", "mpc", 0.95)
            assert raw.rests_on.sec * 10**9 + raw.rests_on.nanosec == sent.rests_on_ns
            assert (raw.twist.linear.x, raw.twist.angular.z) == (0.4, 0.05)
        case "cmd_vel":
            assert (raw.twist.linear.x, raw.twist.angular.z) == (0.4, 0.05)
        case "wrench":
            assert (raw.wrench.force.x, raw.wrench.torque.z) == (sent.force[0], 0.3)
        case "odom":
            assert raw.child_frame_id == "support"
            assert (raw.pose.pose.position.z, raw.twist.twist.linear.x) == (0.95, 0.4)


def test_mcap_ros2_support_decodes_a_recording(bag: Path) -> None:
    file = bag if bag.is_file() else bag / "walk_0.mcap"
    seen: dict[str, int] = dict.fromkeys(COUNTS, 0)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            assert (schema.encoding, schema.name) == ("ros2msg", TYPES[channel.topic])
            assert channel.message_encoding == "cdr"
            assert message.publish_time == message.log_time - 300_000
            if not seen[channel.topic]:
                check_values(channel.topic, decoded)
            seen[channel.topic] += 1
    assert seen == COUNTS


def test_the_definitions_inside_keep_their_units(bag: Path) -> None:
    file = bag if bag.is_file() else bag / "walk_0.mcap"
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    texts = {schema.name: schema.data.decode() for schema in summary.schemas.values()}
    assert "# slowly adapting body scale [px]" in texts["surefoot_msgs/msg/Keypoints"]
    for text in texts.values():
        assert "MSG: std_msgs/Header" in text
        assert "MSG: builtin_interfaces/Time" in text


def test_rosbags_reads_a_recording_with_the_definitions_inside(bag: Path) -> None:
    seen: dict[str, int] = dict.fromkeys(COUNTS, 0)
    with AnyReader([bag]) as reader:
        assert reader.message_count == len(EVENTS)
        assert reader.start_time == EVENTS[0].sample.arrival_ns
        assert reader.end_time == EVENTS[-1].sample.arrival_ns + 1
        assert {connection.topic: connection.msgtype for connection in reader.connections} == TYPES
        for connection, arrival_ns, payload in reader.messages():
            assert START_NS <= arrival_ns <= EVENTS[-1].sample.arrival_ns
            if not seen[connection.topic]:
                check_values(connection.topic, reader.deserialize(payload, connection.msgtype))
            seen[connection.topic] += 1
    assert seen == COUNTS


IDL: dict[str, Any] = {
    "detections": KeypointsIdl,
    "keypoints": KeypointsIdl,
    "fall_horizon": FallHorizonIdl,
    "wrench": WrenchStampedIdl,
    "odom": OdometryIdl,
    "support_command": SupportCommandIdl,
    "cmd_vel": TwistStampedIdl,
    "diagnostics": DiagnosticArrayIdl,
}
EVERY_TOPIC = pytest.mark.parametrize("topic", TOPICS, ids=[topic.key for topic in TOPICS])


def test_there_is_a_foreign_definition_of_every_topic() -> None:
    assert set(IDL) == {topic.key for topic in TOPICS}


@EVERY_TOPIC
def test_pycdr2_decodes_the_bytes_on_the_wire(topic: Topic, wire: dict[str, WireSample]) -> None:
    check_values(f"/surefoot/{topic.key}", IDL[topic.key].deserialize(wire[f"surefoot/{topic.key}"].payload))


def test_the_rest_of_a_command_too(wire: dict[str, WireSample]) -> None:
    sent: Any = first("/surefoot/support_command").message
    raw = SupportCommandIdl.deserialize(wire["surefoot/support_command"].payload)
    assert (raw.sequence, raw.valid, raw.reason, raw.lifetime_s) == (0, True, "", 0.06)
    assert list(raw.damping) == sent.damping.tolist()
    assert list(raw.acceleration) == sent.acceleration.tolist()
    assert np.isnan(raw.fall_distance)


def test_keys_and_encoding_are_those_of_zenoh_bridge_ros2dds(wire: dict[str, WireSample]) -> None:
    """The ROS 2 name without its leading slash; CDR named as such (zenoh-plugin-ros2dds)."""
    assert set(wire) == {name.lstrip("/") for name in TYPES}
    assert {sample.encoding for sample in wire.values()} == {"application/cdr"}
    assert all(sample.payload[:4] == b"\x00\x01\x00\x00" for sample in wire.values()), "little-endian plain CDR"


@EVERY_TOPIC
def test_pycdr2_writes_the_same_bytes(topic: Topic) -> None:
    payload = encode(topic, first(f"/surefoot/{topic.key}").message)
    again = IDL[topic.key].deserialize(payload).serialize()
    padding = len(payload) - len(again)  # a trailing alignment is the writer's choice
    assert abs(padding) < 4
    shorter = min(len(payload), len(again))
    assert again[4:shorter] == payload[4:shorter]


class WireSample(NamedTuple):
    payload: bytes
    encoding: str


@pytest.fixture(scope="module")
def wire() -> dict[str, WireSample]:
    """What a Zenoh subscriber of its own, without any of Surefoot's reading code, receives of each topic."""
    port = free_ports(1)[0]
    config = BridgeConfig(endpoints={"perception": f"tcp/127.0.0.1:{port}"})
    settings = zenoh.Config()
    for path, value in {
        "connect/endpoints": [f"tcp/127.0.0.1:{port}"],
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
    }.items():
        settings.insert_json5(path, json.dumps(value))
    transport = ZenohTransport(config, "perception", SystemClock())
    got: dict[str, WireSample] = {}
    complete = threading.Event()

    def receive(sample: Any) -> None:
        got[str(sample.key_expr)] = WireSample(sample.payload.to_bytes(), str(sample.encoding))
        if len(got) == len(TOPICS):
            complete.set()

    session = zenoh.open(settings)
    subscriber = session.declare_subscriber("surefoot/*", zenoh.handlers.Callback(receive, indirect=False))
    try:
        for _ in range(300):  # until the subscriber is known to the publishers
            for topic in TOPICS:
                outbox = Outbox(transport, topic)
                outbox.send(first(f"/surefoot/{topic.key}").message)
                outbox.close()
            if complete.wait(0.1):
                return got
        raise AssertionError(f"only {sorted(got)} arrived")
    finally:
        subscriber.undeclare()
        session.close()
        transport.close()


def test_the_stamp_is_found_without_decoding() -> None:
    for event in EVENTS[:20]:
        assert header_stamp_ns(event.sample.payload) == event.message.stamp_ns
    payload = EVENTS[0].sample.payload
    big_endian = b"\x00\x00\x00\x00" + payload[7:3:-1] + payload[11:7:-1] + payload[12:]
    assert header_stamp_ns(big_endian) == EVENTS[0].message.stamp_ns
    assert header_stamp_ns(b"\x00\x01\x00\x00") is None


def test_a_foreign_file_is_read_too(tmp_path: Path) -> None:
    """Written by `rosbags`, as `ros2 bag record` would: no publisher named, one channel a topic."""
    with Writer(tmp_path / "foreign", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            topic.key: writer.add_connection(f"/surefoot/{topic.key}", topic.ros_type, typestore=STORE)
            for topic in TOPICS
        }
        other = writer.add_connection("/camera_info", "std_msgs/msg/String", typestore=STORE)
        writer.write(other, START_NS, b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00")
        for event in EVENTS:
            writer.write(connections[event.topic.key], event.sample.arrival_ns, event.sample.payload)
    recording = Recording(tmp_path / "foreign")
    found = [(recorded.topic, recorded.sample) for recorded in recording.samples()]
    assert found == [(event.topic, Sample(event.sample.payload, -1, b"", event.sample.arrival_ns)) for event in EVENTS]
    assert recording.foreign == {("/camera_info", "std_msgs/msg/String"): 1}
