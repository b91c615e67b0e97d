"""What streams are called on the wire, in either of two conventions that ROS 2 understands.

`ros2dds`: as zenoh-bridge-ros2dds maps them, the ROS 2 name without its leading slash, encoding
`application/cdr`. `rmw_zenoh`: see `bridge.transport.rmw_zenoh`.

That a role is up is told in both by the token `<namespace>/alive/<role>`, which is no topic of ROS 2.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Final, Protocol

from bridge.codec import TYPES
from bridge.config.bridge import BridgeConfig
from bridge.topics import TOPICS, Topic
from bridge.transport.rmw_zenoh import ADMIN_SPACE, NodeName, data_key, mangle

CDR: Final = "application/cdr"


@cache
def type_hash(ros_type: str) -> str:
    """Return the REP 2016 hash of a type, `RIHS01_` and 64 hexadecimal digits."""
    return str(TYPES.hash_rihs01(ros_type))


class Names(Protocol):
    """One convention, for one robot."""

    @property
    def encoding(self) -> str | None:
        """Encoding announced with every sample; None: Zenoh's default."""
        ...

    @property
    def space(self) -> tuple[str, ...]:
        """Key expressions that include everything that is named here."""
        ...

    def key(self, topic: Topic) -> str:
        """Return the key expression of `topic`."""
        ...

    def alive(self, role: str) -> str:
        """Return the liveliness token of `role` when it is up; '*' for every role."""
        ...

    def graph(self, role: str) -> tuple[str, ...]:
        """Return the liveliness tokens with which `role` shows itself to ROS 2; '*' for every role."""
        ...

    def node(self, session: str, role: str) -> NodeName | None:
        """Return the ROS 2 node that `role` is; None where there are none on the wire."""
        ...


class Ros2ddsNames:
    """`surefoot/keypoints`."""

    encoding: Final = CDR

    def __init__(self, namespace: str) -> None:
        self._namespace = namespace
        self.space = (f"{namespace}/**",)

    def key(self, topic: Topic) -> str:
        """Return the key expression of `topic`."""
        return f"{self._namespace}/{topic.key}"

    def alive(self, role: str) -> str:
        """Return the liveliness token of `role`."""
        return _alive(self._namespace, role)

    def graph(self, role: str) -> tuple[str, ...]:  # noqa: ARG002
        """Return nothing: the bridge shows the topics to ROS 2."""
        return ()

    def node(self, session: str, role: str) -> None:  # noqa: ARG002
        """Return nothing: the bridge is the node."""
        return


class RmwZenohNames:
    """`0/surefoot/keypoints/surefoot_msgs::msg::dds_::Keypoints_/RIHS01_...`."""

    encoding: Final = None  # rmw_zenoh announces none

    def __init__(self, namespace: str, domain: int) -> None:
        self._namespace, self._domain = namespace, domain
        # `**` does not match a part that begins with `@`
        self.space = (f"{domain}/{namespace}/**", f"{namespace}/alive/*", f"{ADMIN_SPACE}/{domain}/**")

    def key(self, topic: Topic) -> str:
        """Return the key expression of `topic`."""
        return data_key(self._domain, f"{self._namespace}/{topic.key}", topic.ros_type, type_hash(topic.ros_type))

    def alive(self, role: str) -> str:
        """Return the liveliness token of `role`."""
        return _alive(self._namespace, role)

    def graph(self, role: str) -> tuple[str, ...]:
        """Return what includes the tokens of the node `role` and of its publishers and subscriptions."""
        node = f"{ADMIN_SPACE}/{self._domain}/*/*/*/*/*/{mangle('/' + self._namespace)}/{role}"
        return (node, f"{node}/*/*/*/*")

    def node(self, session: str, role: str) -> NodeName:
        """Return the node, such as `/surefoot/perception`."""
        return NodeName(self._domain, session, f"/{self._namespace}", role)


def names_of(config: BridgeConfig) -> Names:
    """Return the convention that `config` chooses."""
    if config.naming == "rmw_zenoh":
        return RmwZenohNames(config.namespace, config.domain)
    return Ros2ddsNames(config.namespace)


def _alive(namespace: str, role: str) -> str:
    return f"{namespace}/alive/{role}"


def written_by(role: str) -> Iterable[Topic]:
    """Return the topics that `role` may write, the diagnostics of every role among them."""
    return (topic for topic in TOPICS if topic.publisher in (role, "*"))
