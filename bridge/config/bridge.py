"""Configuration of the wire."""

from __future__ import annotations

import ipaddress
import re
from typing import Any, Final, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from bridge.config.section import Section

DEFAULT_ENDPOINTS: Final = {
    "perception": "tcp/127.0.0.1:7471",
    "anticipation": "tcp/127.0.0.1:7472",
    "controller": "tcp/127.0.0.1:7473",
    "drive": "tcp/127.0.0.1:7474",
}
DEFAULT_ROUTER: Final = "tcp/127.0.0.1:7470"
AUTHENTICATED: Final = ("tls", "quic")  # protocols that prove who is at the other end
_ENDPOINT = re.compile(r"^(tcp|udp|tls|quic)/(\[[0-9a-fA-F:]+\]|[^:/\[\]]+):(\d{1,5})$")


def is_loopback(endpoint: str) -> bool:
    """Return whether `endpoint` (such as `tcp/127.0.0.1:7471`) stays on this machine."""
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return False
    host = match.group(2).strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_authenticated(endpoint: str) -> bool:
    """Return whether whoever is at `endpoint` proves with a certificate who it is."""
    return endpoint.partition("/")[0] in AUTHENTICATED


def _default(endpoint: str, keys: str) -> str:
    return f"tls/{endpoint.partition('/')[2]}" if keys else endpoint


class RouterConfig(Section):
    """What `surefoot router` does: it joins the processes of several machines."""

    listen: tuple[str, ...] = ()
    """Where it listens: an address of this machine that the others reach, and one for the processes here.
    [] means 127.0.0.1:7470, by TLS where `bridge.keys` is set."""

    connect: tuple[str, ...] = ()
    """Routers of other machines; one side of a pair is enough."""


class BridgeConfig(Section):
    """Where the processes meet, and who may say what."""

    namespace: str = Field(default="surefoot", pattern=r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$")
    """First part of every key; give each robot on one network its own."""

    naming: Literal["ros2dds", "rmw_zenoh"] = "ros2dds"
    """Keys as zenoh-bridge-ros2dds maps them, or as ROS 2 nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp use them
    (then with mode = "client", or their router hands nothing on)."""

    domain: int = Field(default=0, ge=0, le=232)
    """ROS_DOMAIN_ID of those ROS 2 nodes; used with naming = "rmw_zenoh" alone."""

    keys: str = ""
    """Folder of certificates made by `surefoot keys`; with it every link is mutual TLS and every role may write
    its own topics alone. "" = no certificates, so everything stays on this machine."""

    mode: Literal["peer", "client"] = "peer"
    """peer: processes listen at their endpoints and connect to each other. client: nobody listens, all goes
    through the routers in `connect`."""

    endpoints: dict[str, str] = Field(default_factory=dict, validate_default=True)
    """Where each role listens; the others connect there. Roles left out keep their default; "" = runs elsewhere."""

    connect: tuple[str, ...] = ()
    """Further Zenoh endpoints to connect to, such as a router."""

    lease_ms: int = Field(default=300, ge=50, le=10_000)
    """A frozen or unreachable peer is declared dead after this long [ms]."""

    allow_remote_without_tls: bool = False
    """Permit endpoints that are neither loopback nor TLS. Anyone on that network can then command the robot."""

    router: RouterConfig = RouterConfig()
    """What `surefoot router` does: it joins the processes of several machines."""

    @property
    def router_listen(self) -> tuple[str, ...]:
        """Where the router listens."""
        return self.router.listen or (_default(DEFAULT_ROUTER, self.keys),)

    @field_validator("endpoints", mode="before")
    @classmethod
    def _add_defaults(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        chosen = {**DEFAULT_ENDPOINTS, **value}
        for role, endpoint in DEFAULT_ENDPOINTS.items():
            if chosen[role] == endpoint:  # nobody chose it, or it was written out as the default
                chosen[role] = _default(endpoint, info.data.get("keys", ""))
        return {role: endpoint for role, endpoint in chosen.items() if endpoint != ""}

    @model_validator(mode="after")
    def _check_endpoints(self) -> Self:
        named = [(f"endpoints.{role}", endpoint) for role, endpoint in self.endpoints.items()]
        named += [("connect", endpoint) for endpoint in self.connect]
        named += [("router.listen", endpoint) for endpoint in self.router.listen]
        named += [("router.connect", endpoint) for endpoint in self.router.connect]
        for name, endpoint in named:
            self._check(name, endpoint)
        if self.mode == "client" and not self.connect:
            raise ValueError("mode is 'client', which needs a router: set connect, such as ['tcp/127.0.0.1:7470']")
        return self

    def _check(self, name: str, endpoint: str) -> None:
        match = _ENDPOINT.match(endpoint)
        if match is None or not 1 <= int(match.group(3)) <= 65535:
            raise ValueError(f"{name} is '{endpoint}', expected PROTOCOL/HOST:PORT such as tcp/127.0.0.1:7471")
        if self.keys and not is_authenticated(endpoint):
            raise ValueError(
                f"{name} is '{endpoint}', where nobody shows a certificate; with keys set use tls/ or quic/"
            )
        if not (is_authenticated(endpoint) or is_loopback(endpoint) or self.allow_remote_without_tls):
            raise ValueError(
                f"{name} is '{endpoint}', which leaves this machine without TLS; "
                "use tls/ or quic/, or set allow_remote_without_tls = true on a network you trust"
            )
