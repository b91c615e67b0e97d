"""Configuration of the wire."""

from __future__ import annotations

import ipaddress
import re
from typing import Any, Final, Self

from pydantic import Field, field_validator, model_validator

from bridge.config.section import Section

DEFAULT_ENDPOINTS: Final = {
    "perception": "tcp/127.0.0.1:7471",
    "anticipation": "tcp/127.0.0.1:7472",
    "controller": "tcp/127.0.0.1:7473",
    "drive": "tcp/127.0.0.1:7474",
}
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


class BridgeConfig(Section):
    """Where the processes meet."""

    namespace: str = Field(default="surefoot", pattern=r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$")
    """First part of every key; give each robot on one network its own."""

    endpoints: dict[str, str] = Field(default_factory=lambda: dict(DEFAULT_ENDPOINTS))
    """Where each role listens; the others connect there. Roles left out keep their default."""

    connect: tuple[str, ...] = ()
    """Further Zenoh endpoints to connect to, such as a router."""

    lease_ms: int = Field(default=300, ge=50, le=10_000)
    """A frozen or unreachable peer is declared dead after this long [ms]."""

    allow_remote_without_tls: bool = False
    """Permit endpoints that are neither loopback nor TLS. Anyone on that network can then command the robot."""

    @field_validator("endpoints", mode="before")
    @classmethod
    def _add_defaults(cls, value: Any) -> Any:
        return {**DEFAULT_ENDPOINTS, **value} if isinstance(value, dict) else value

    @model_validator(mode="after")
    def _check_endpoints(self) -> Self:
        named = [(f"endpoints.{role}", endpoint) for role, endpoint in self.endpoints.items()]
        for name, endpoint in named + [("connect", endpoint) for endpoint in self.connect]:
            match = _ENDPOINT.match(endpoint)
            if match is None or not 1 <= int(match.group(3)) <= 65535:
                raise ValueError(f"{name} is '{endpoint}', expected PROTOCOL/HOST:PORT such as tcp/127.0.0.1:7471")
            secure = match.group(1) in {"tls", "quic"}
            if not (secure or is_loopback(endpoint) or self.allow_remote_without_tls):
                raise ValueError(
                    f"{name} is '{endpoint}', which leaves this machine without TLS; "
                    "use tls/ or quic/, or set allow_remote_without_tls = true on a network you trust"
                )
        return self
