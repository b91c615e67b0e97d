"""The wire between processes and machines: one Zenoh session per process, explicit endpoints, no discovery."""

from __future__ import annotations

import itertools
import json
import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import zenoh

from bridge.clock import Clock
from bridge.config.bridge import BridgeConfig, is_authenticated
from bridge.errors import TransportError
from bridge.keys.check import Credentials, load_credentials
from bridge.keys.identity import OBSERVER, ROUTER, identity_of
from bridge.topics import Topic
from bridge.transport.attachment import IDENTIFIER_BYTES, pack, unpack
from bridge.transport.interface import Sample
from bridge.transport.names import names_of, type_hash
from bridge.transport.rmw_zenoh import OFFERED_QOS, Endpoint, identifier
from bridge.transport.session import zenoh_settings
from bridge.transport.waiting import open_waiting

ROUTER_WAIT_S: Final = 30.0  # who only looks does not wait for ever

_LOG = logging.getLogger("bridge.transport")


class _ZenohPublisher:
    def __init__(self, publisher: Any, source: bytes, token: Any) -> None:
        self._publisher, self._source, self._token, self._sequence = publisher, source, token, 0

    def put(self, payload: bytes, stamp_ns: int) -> None:
        self._publisher.put(payload, attachment=pack(self._sequence, stamp_ns, self._source))
        self._sequence += 1

    def close(self) -> None:
        self._publisher.undeclare()
        if self._token is not None:
            self._token.undeclare()


class _ZenohHandle:
    def __init__(self, *entities: Any) -> None:
        self._entities = entities

    def close(self) -> None:
        entities, self._entities = self._entities, ()
        for entity in entities:
            entity.undeclare()


class ZenohTransport:
    """`Transport` over a Zenoh session of its own.

    Raises:
        TransportError: the endpoint of `role` is taken or malformed, or wants certificates where there are none; or it
            is a client who only looks, and no router answers.
        KeysError: the certificates of `role` cannot be used.

    Attributes:
        session: Zenoh's; closed with the transport.
    """

    def __init__(self, config: BridgeConfig, role: str, clock: Clock) -> None:
        self._clock, self._names = clock, names_of(config)
        self._declared: list[_ZenohHandle] = []  # Zenoh undeclares what nobody refers to any more
        self.session: Any = open_session(config, role)
        self._entities = itertools.count(1)  # 0 is the node itself
        self._node = self._names.node(str(self.session.info.zid()), role)
        if self._node is not None:
            self._keep(self.session.liveliness().declare_token(self._node.token()))

    def publisher(self, topic: Topic) -> _ZenohPublisher:
        """Declare `topic`; samples are dropped rather than queued when a reader is slow."""
        encoding = self._names.encoding
        publisher = self.session.declare_publisher(
            self._names.key(topic),
            encoding=None if encoding is None else zenoh.Encoding(encoding),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=getattr(zenoh.Priority, topic.priority.upper()),
            express=topic.express,
        )
        key, token = self._show(Endpoint.PUBLISHER, topic)
        return _ZenohPublisher(publisher, identifier(key) if key else os.urandom(IDENTIFIER_BYTES), token)

    def subscribe(self, topic: Topic, callback: Callable[[Sample], None]) -> _ZenohHandle:
        """Call `callback` from Zenoh's own thread with every sample of `topic`."""
        clock = self._clock

        def receive(sample: Any) -> None:
            attachment = sample.attachment
            sequence, source = unpack(b"" if attachment is None else attachment.to_bytes())
            callback(Sample(sample.payload.to_bytes(), sequence, source, clock.now_ns()))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        subscriber = self.session.declare_subscriber(self._names.key(topic), handler)
        _key, token = self._show(Endpoint.SUBSCRIPTION, topic)
        return self._keep(subscriber) if token is None else self._keep(subscriber, token)

    def declare_alive(self, role: str) -> _ZenohHandle:
        """Declare the liveliness token of `role`; it vanishes with the process."""
        return self._keep(self.session.liveliness().declare_token(self._names.alive(role)))

    def watch_alive(self, callback: Callable[[str, bool], None]) -> _ZenohHandle:
        """Call `callback(role, alive)` for the roles alive now and at every change."""

        def receive(sample: Any) -> None:
            role = str(sample.key_expr).rsplit("/", 1)[-1]
            callback(role, sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(receive, indirect=False)
        return self._keep(self.session.liveliness().declare_subscriber(self._names.alive("*"), handler, history=True))

    def close(self) -> None:
        """Close the session; everything it declared goes with it."""
        for handle in reversed(self._declared):
            handle.close()
        self.session.close()

    def _show(self, kind: Endpoint, topic: Topic) -> tuple[str, Any]:
        """Show an endpoint to ROS 2; return the key of its token and the token, or nothing where that is not done."""
        if self._node is None:
            return "", None
        name = f"{self._node.namespace}/{topic.key}"
        number, hashed = next(self._entities), type_hash(topic.ros_type)
        key = self._node.endpoint_token(number, kind, name, topic.ros_type, hashed, OFFERED_QOS)
        return key, self.session.liveliness().declare_token(key)

    def _keep(self, *entities: Any) -> _ZenohHandle:
        handle = _ZenohHandle(*entities)
        self._declared.append(handle)
        return handle


def open_session(config: BridgeConfig, role: str) -> Any:
    """Return a Zenoh session for `role`.

    Raises:
        TransportError: the endpoint of `role` is taken or malformed, or wants certificates where there are none.
        KeysError: the certificates of `role` cannot be used.
    """
    settings = zenoh_settings(config, role, _credentials(config, role))
    zenoh_config = zenoh.Config()
    for path, value in settings.items():
        zenoh_config.insert_json5(path, json.dumps(value))
    try:
        if settings["mode"] == "client":
            limit_s = ROUTER_WAIT_S if identity_of(role) == OBSERVER else None
            return open_waiting(lambda: zenoh.open(zenoh_config), role, config.connect, limit_s)
        return zenoh.open(zenoh_config)
    except zenoh.ZError as error:
        endpoint = ", ".join(settings["listen/endpoints"]) or "none"
        detail = str(error)
        if "Address already in use" in detail or "os error 98" in detail:
            key = "bridge.router.listen" if role == ROUTER else f"bridge.endpoints.{role}"
            raise TransportError(
                f"{role} cannot listen on {endpoint}: the port is in use (is another {role} running?); set {key}"
            ) from error
        raise TransportError(f"{role} cannot open the wire at {endpoint}: {detail.splitlines()[0]}") from error


def _credentials(config: BridgeConfig, role: str) -> Credentials | None:
    if config.keys:
        credentials = load_credentials(Path(config.keys), identity_of(role))
        for warning in credentials.warnings:
            _LOG.warning("%s", warning)
        return credentials
    for endpoint in (*config.endpoints.values(), *config.connect, *config.router.listen, *config.router.connect):
        if is_authenticated(endpoint):
            raise TransportError(f"{endpoint} wants certificates: set bridge.keys, see surefoot keys --help")
    return None
