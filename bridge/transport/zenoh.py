"""The wire between processes and machines: one Zenoh peer per process, explicit endpoints, no discovery.

Each sample carries an attachment laid out as rmw_zenoh's: sequence number (int64),
source timestamp [ns] (int64), length of the publisher's identifier (uint8 = 16) and
the identifier, all little-endian.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from typing import Any, Final

import zenoh

from bridge.clock import Clock
from bridge.config.bridge import BridgeConfig
from bridge.errors import TransportError
from bridge.topics import Topic
from bridge.transport.interface import Sample

_ATTACHMENT: Final = struct.Struct("<qqB16s")
_ENCODING: Final = zenoh.Encoding.APPLICATION_CDR if hasattr(zenoh.Encoding, "APPLICATION_CDR") else None


def _zenoh_config(config: BridgeConfig, role: str) -> Any:
    """Return the Zenoh configuration of `role`: it listens where its endpoint is and connects to the others.

    Roles connect only to those listed before them, so that a pair of processes
    opens one link and not two; a role without an endpoint connects to all.
    """
    roles = list(config.endpoints)
    listens = role in config.endpoints
    others = roles[: roles.index(role)] if listens else roles
    settings: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": [config.endpoints[role]] if listens else [],
        "listen/exit_on_failure": True,
        "connect/endpoints": [config.endpoints[other] for other in others] + list(config.connect),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 400, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": config.lease_ms,
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": 1 << 20,
        "transport/shared_memory/enabled": False,
    }
    result = zenoh.Config()
    for path, value in settings.items():
        result.insert_json5(path, json.dumps(value))
    return result


def _parse_attachment(attachment: Any) -> tuple[int, bytes]:
    raw = b"" if attachment is None else attachment.to_bytes()
    if len(raw) != _ATTACHMENT.size:
        return -1, b""
    sequence, _stamp, length, source = _ATTACHMENT.unpack(raw)
    return (sequence, source) if length == 16 else (-1, b"")


class _ZenohPublisher:
    def __init__(self, publisher: Any) -> None:
        self._publisher, self._source, self._sequence = publisher, os.urandom(16), 0

    def put(self, payload: bytes, stamp_ns: int) -> None:
        attachment = _ATTACHMENT.pack(self._sequence, stamp_ns, 16, self._source)
        self._publisher.put(payload, attachment=attachment)
        self._sequence += 1

    def close(self) -> None:
        self._publisher.undeclare()


class _ZenohHandle:
    def __init__(self, entity: Any) -> None:
        self._entity = entity

    def close(self) -> None:
        if self._entity is not None:
            self._entity.undeclare()
            self._entity = None


class ZenohTransport:
    """`Transport` over a Zenoh session of its own.

    Raises:
        TransportError: the endpoint of `role` is taken or malformed.
    """

    def __init__(self, config: BridgeConfig, role: str, clock: Clock) -> None:
        self._namespace, self._clock = config.namespace, clock
        self._declared: list[_ZenohHandle] = []  # Zenoh undeclares what nobody refers to any more
        try:
            self._session: Any = zenoh.open(_zenoh_config(config, role))
        except zenoh.ZError as error:
            endpoint = config.endpoints.get(role, "none")
            detail = str(error)
            if "Address already in use" in detail or "os error 98" in detail:
                raise TransportError(
                    f"{role} cannot listen on {endpoint}: the port is in use (is another {role} running?); "
                    f"set bridge.endpoints.{role}"
                ) from error
            raise TransportError(f"{role} cannot open the wire at {endpoint}: {detail.splitlines()[0]}") from error

    def publisher(self, topic: Topic) -> _ZenohPublisher:
        """Declare `topic`; samples are dropped rather than queued when a reader is slow."""
        return _ZenohPublisher(
            self._session.declare_publisher(
                f"{self._namespace}/{topic.key}",
                encoding=_ENCODING,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=getattr(zenoh.Priority, topic.priority.upper()),
                express=topic.express,
            )
        )

    def subscribe(self, topic: Topic, callback: Callable[[Sample], None]) -> _ZenohHandle:
        """Call `callback` from Zenoh's own thread with every sample of `topic`."""
        clock = self._clock

        def receive(sample: Any) -> None:
            sequence, source = _parse_attachment(sample.attachment)
            callback(Sample(sample.payload.to_bytes(), sequence, source, clock.now_ns()))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        return self._keep(self._session.declare_subscriber(f"{self._namespace}/{topic.key}", handler))

    def declare_alive(self, role: str) -> _ZenohHandle:
        """Declare the liveliness token of `role`; it vanishes with the process."""
        return self._keep(self._session.liveliness().declare_token(f"{self._namespace}/alive/{role}"))

    def watch_alive(self, callback: Callable[[str, bool], None]) -> _ZenohHandle:
        """Call `callback(role, alive)` for the roles alive now and at every change."""

        def receive(sample: Any) -> None:
            role = str(sample.key_expr).rsplit("/", 1)[-1]
            callback(role, sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(receive, indirect=False)
        tokens = f"{self._namespace}/alive/*"
        return self._keep(self._session.liveliness().declare_subscriber(tokens, handler, history=True))

    def close(self) -> None:
        """Close the session; everything it declared goes with it."""
        for handle in reversed(self._declared):
            handle.close()
        self._session.close()

    def _keep(self, entity: Any) -> _ZenohHandle:
        handle = _ZenohHandle(entity)
        self._declared.append(handle)
        return handle
