"""Names as rmw_zenoh gives them, so that ROS 2 nodes with `RMW_IMPLEMENTATION=rmw_zenoh_cpp` see the processes.

    data       <domain>/<topic>/<type>/<type hash>
    node       @ros2_lv/<domain>/<session>/<node>/<node>/NN/<enclave>/<namespace>/<name>
    endpoint   @ros2_lv/<domain>/<session>/<node>/<entity>/<kind>/<enclave>/<namespace>/<name>
               /<topic>/<type>/<type hash>/<QoS>, where the kind is MP or MS

Inside one part of a token a slash is written `%`. Source: ros2/rmw_zenoh, `docs/design.md`
and `rmw_zenoh_cpp/src/detail/{liveliness_utils,qos}.cpp`; type hashes: REP 2016.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

import xxhash

ADMIN_SPACE: Final = "@ros2_lv"
_SLASH: Final = "%"


class Endpoint(StrEnum):
    """Kinds of entity that have a topic."""

    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"


class Qos(NamedTuple):
    """The parts of a QoS profile that are ever set here; the numbers are rmw's enumerations (`rmw/types.h`)."""

    reliability: int = 1  # 1 reliable, 2 best effort
    durability: int = 2  # 1 transient local, 2 volatile
    history: int = 1  # 1 keep last, 2 keep all
    depth: int = 42


DEFAULT_QOS: Final = Qos()  # rmw_zenoh's own defaults, which its tokens leave out
OFFERED_QOS: Final = Qos(depth=10)  # ROS 2's default profile


def type_name(ros_type: str) -> str:
    """Return the DDS name of a type, such as `std_msgs::msg::dds_::String_` for `std_msgs/msg/String`."""
    package, kind, name = ros_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def data_key(domain: int, topic: str, ros_type: str, type_hash: str) -> str:
    """Return the key expression on which the samples of `topic` (a ROS 2 name) travel."""
    return f"{domain}/{topic.strip('/')}/{type_name(ros_type)}/{type_hash}"


def mangle(name: str) -> str:
    """Return `name` as one part of a key expression."""
    return name.replace("/", _SLASH)


def qos_part(qos: Qos) -> str:
    """Return `reliability:durability:history,depth:deadline:lifespan:liveliness`, empty where it is the default."""

    def shown(name: str) -> str:
        value = getattr(qos, name)
        return "" if value == getattr(DEFAULT_QOS, name) else str(value)

    reliability, durability, history, depth = (shown(name) for name in Qos._fields)
    return f"{reliability}:{durability}:{history},{depth}:,:,:,,"


class NodeName(NamedTuple):
    """One node of one session."""

    domain: int
    session: str  # Zenoh's identifier of the session, hexadecimal
    namespace: str  # with its leading slash; '/' is the root
    name: str
    number: int = 0  # of the node within the session
    enclave: str = "/"

    def token(self) -> str:
        """Return the liveliness token that says the node is there."""
        return self._token(self.number, "NN")

    def endpoint_token(self, number: int, kind: Endpoint, topic: str, ros_type: str, type_hash: str, qos: Qos) -> str:
        """Return the liveliness token of a publisher or subscription of this node.

        Args:
            number: of the entity within the session; no other entity has it.
            kind: what it is.
            topic: ROS 2 name with its leading slash.
            ros_type: such as `std_msgs/msg/String`.
            type_hash: such as `RIHS01_df66...`.
            qos: offered or asked for.
        """
        parts = (mangle(topic), type_name(ros_type), type_hash, qos_part(qos))
        return "/".join((self._token(number, kind), *parts))

    def _token(self, number: int, kind: str) -> str:
        place = f"{ADMIN_SPACE}/{self.domain}/{self.session}/{self.number}/{number}/{kind}"
        return f"{place}/{mangle(self.enclave)}/{mangle(self.namespace)}/{mangle(self.name)}"


def identifier(token: str) -> bytes:
    """Return the 16 bytes that name an entity in attachments: XXH3-128 of its token, low half first."""
    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")
