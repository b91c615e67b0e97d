"""How a recording is laid out: MCAP as rosbag2's MCAP storage plugin writes it, definitions inside.

Sources: the MCAP specification (https://mcap.dev/spec) with its registry (profile `ros2`, message
encoding `cdr`, schema encoding `ros2msg`), and rosbag2's `metadata.yaml`, version 8.

One channel per topic and publisher: the channel's metadata names the publisher, so that
gaps, restarts and duplicates can still be told apart when the recording is read.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, NamedTuple

from bridge.clock import NS
from bridge.codec import OWN_TYPES, TYPES, message_definition
from bridge.topics import TOPICS, Topic

SUFFIX: Final = ".mcap"
PROFILE: Final = "ros2"
SCHEMA_ENCODING: Final = "ros2msg"
MESSAGE_ENCODING: Final = "cdr"
SOURCE_KEY: Final = "surefoot_publisher"  # channel metadata: publisher's identifier, hexadecimal
HASH_KEY: Final = "topic_type_hash"  # channel metadata: of the type's fields (REP 2016)
ABOUT: Final = "surefoot"  # name of the metadata record that says what was listened to
LIBRARY: Final = f"surefoot {version('surefoot')}"
METADATA_FILE: Final = "metadata.yaml"

_METADATA_VERSION = 8  # read by ROS 2 Humble and later
_DISTRO = "jazzy"  # the distribution whose standard types are used
_SEPARATOR = "=" * 80
_FOREVER = {"sec": 9_223_372_036, "nsec": 854_775_807}  # rmw's way to say 'no limit'
_QOS: Final = json.dumps(  # JSON is YAML; the numbers are rmw's enumerations
    [
        {
            "history": 1,  # keep last
            "depth": 10,
            "reliability": 1,  # reliable: what every subscriber may ask for
            "durability": 2,  # volatile
            "deadline": _FOREVER,
            "lifespan": _FOREVER,
            "liveliness": 1,  # automatic
            "liveliness_lease_duration": _FOREVER,
            "avoid_ros_namespace_conventions": False,
        }
    ]
)


def channel_topic(namespace: str, topic: Topic) -> str:
    """Return the ROS 2 name of a topic, such as `/surefoot/keypoints`."""
    return f"/{namespace}/{topic.key}"


def split_channel_topic(name: str, ros_type: str) -> tuple[str, Topic] | None:
    """Return namespace and topic of a channel; None if it is not one of ours."""
    namespace, _, key = name.strip("/").rpartition("/")
    for topic in TOPICS:
        if topic.key == key and topic.ros_type == ros_type:
            return namespace, topic
    return None


def schema_text(ros_type: str) -> str:
    """Return the definition of `ros_type` and of all it contains, concatenated as rosbag2 does it.

    The project's own types keep the comments of their `.msg` files, which hold the units.
    """
    text: str = TYPES.generate_msgdef(ros_type, ros_version=2)[0]
    name = ros_type.rpartition("/")[2]
    if ros_type.startswith("surefoot_msgs/") and name in OWN_TYPES:
        _own, *parts = text.split(_SEPARATOR)
        return _SEPARATOR.join([message_definition(name), *parts])
    return text


def channel_metadata(topic: Topic, source: bytes) -> dict[str, str]:
    """Return what the channel of one publisher says about itself."""
    known = {"offered_qos_profiles": _QOS, HASH_KEY: TYPES.hash_rihs01(topic.ros_type)}
    return {**known, SOURCE_KEY: source.hex()} if source else known


def has_present_definition(topic: Topic, metadata: Mapping[str, str]) -> bool:
    """Whether messages of a channel are laid out as this version has them; one that does not say is believed."""
    return metadata.get(HASH_KEY, "") in {"", TYPES.hash_rihs01(topic.ros_type)}


def source_of(metadata: Mapping[str, str]) -> bytes:
    """Return the publisher a channel belongs to; empty if it does not say, or says nonsense."""
    try:
        return bytes.fromhex(metadata.get(SOURCE_KEY, ""))
    except ValueError:
        return b""


def header_stamp_ns(payload: bytes) -> int | None:
    """Return the stamp of the header that every type here begins with [ns]; None if there is none.

    CDR: two bytes of representation, of which the lowest bit of the second says little endian,
    two of options, then `int32 sec, uint32 nanosec` (OMG DDS-XTypes 1.3, 7.4).
    """
    if len(payload) < 12:
        return None
    sec, nanosec = struct.unpack_from("<iI" if payload[1] & 1 else ">iI", payload, 4)
    return int(sec) * NS + int(nanosec) if sec >= 0 else None


class Counted(NamedTuple):
    """What `metadata.yaml` says about a whole recording."""

    counts: Mapping[tuple[str, str], int]  # (ROS 2 name, type) -> messages
    first_ns: int
    last_ns: int


def metadata_text(file: Path, counted: Counted) -> str:
    """Return rosbag2's description of a recording in one file, as JSON, which is YAML."""
    information = bag_information(file, counted)
    return json.dumps({"rosbag2_bagfile_information": information}, indent=2) + "\n"


def bag_information(file: Path, counted: Counted) -> dict[str, Any]:
    """Return rosbag2's bag information (`rosbag2_storage::BagMetadata`, version 8)."""
    total = sum(counted.counts.values())
    start = {"nanoseconds_since_epoch": counted.first_ns}
    duration = {"nanoseconds": counted.last_ns - counted.first_ns}
    return {
        "version": _METADATA_VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.name],
        "duration": duration,
        "starting_time": start,
        "message_count": total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": name,
                    "type": ros_type,
                    "serialization_format": MESSAGE_ENCODING,
                    "offered_qos_profiles": _QOS,
                    "type_description_hash": TYPES.hash_rihs01(ros_type),
                },
                "message_count": count,
            }
            for (name, ros_type), count in counted.counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file.name, "starting_time": start, "duration": duration, "message_count": total}],
        "custom_data": None,
        "ros_distro": _DISTRO,
    }
