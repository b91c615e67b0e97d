"""Finding out before anything starts whether the endpoints of the roles are free."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterable, Mapping
from contextlib import closing

from bridge.errors import TransportError


def require_free(endpoints: Mapping[str, str], roles: Iterable[str]) -> None:
    """Raise unless every one of `roles` can listen where `endpoints` (PROTOCOL/HOST:PORT) says.

    Raises:
        TransportError: names the first role whose port is taken.
    """
    taken: dict[str, str] = {}
    for role in roles:
        endpoint = endpoints.get(role)
        if endpoint is None:
            continue
        if endpoint in taken:
            raise TransportError(f"{role} and {taken[endpoint]} would both listen on {endpoint}")
        taken[endpoint] = role
        if not is_free(endpoint):
            raise TransportError(
                f"{role} cannot listen on {endpoint}: the port is in use (is another {role} running?); "
                f"set bridge.endpoints.{role}"
            )


def free_ports(count: int) -> list[int]:
    """Return TCP ports of the loopback that nobody listens on at the moment."""
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def is_free(endpoint: str) -> bool:
    """Whether nobody listens on `endpoint`; what else may be wrong with it is for the role to say."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    kind = socket.SOCK_DGRAM if protocol in {"udp", "quic"} else socket.SOCK_STREAM
    try:
        found = socket.getaddrinfo(host.strip("[]"), int(port), type=kind, flags=socket.AI_PASSIVE)[0]
    except socket.gaierror:
        return True
    with closing(socket.socket(found[0], kind)) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # links that are closing do not count
        try:
            probe.bind(found[4])
        except OSError as error:
            return error.errno != errno.EADDRINUSE
    return True
