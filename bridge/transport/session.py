"""What a Zenoh session is opened with: explicit endpoints, no discovery, certificates where there are some."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from bridge.config.bridge import BridgeConfig
from bridge.keys.check import Credentials
from bridge.keys.identity import ROUTER
from bridge.transport.access import access_control
from bridge.transport.names import names_of

MAX_MESSAGE_BYTES: Final = 1 << 20  # longer ones are dropped before they are put together
QUEUE: Final = 16  # the most Zenoh allows: half a second of keypoints or horizons while a reader gets no time


def zenoh_settings(config: BridgeConfig, role: str, credentials: Credentials | None) -> dict[str, Any]:
    """Return the settings of the session of `role`, as paths into Zenoh's configuration.

    A peer listens where its endpoint is and connects only to the roles listed before it, so that
    a pair of processes opens one link and not two; a role without an endpoint connects to all. A
    client connects to routers alone.

    Args:
        config: where everybody is.
        role: who opens the session.
        credentials: certificates; None: links prove nothing.
    """
    listen, connect = _links(config, role)
    settings: dict[str, Any] = {
        "mode": "router" if role == ROUTER else config.mode,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 400, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "open/return_conditions/connect_scouted": False,  # nobody is looked for, so nobody is waited for
        "timestamping/enabled": False,
        "transport/link/tx/lease": config.lease_ms,  # the default, 10 s, is how long rmw_zenoh misses a frozen peer
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
        "transport/shared_memory/enabled": False,
        # a sample that is sent at once takes a place of its own, and by default two are all there are
        "transport/link/tx/queue/size/interactive_high": QUEUE,
        "transport/link/tx/queue/size/data_low": QUEUE,
    }
    if credentials is not None:
        settings["transport/link/tls"] = _tls(credentials)
        settings["access_control"] = access_control(names_of(config))
    return settings


def nested(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings by path (`connect/endpoints`) as the nested object that a file of Zenoh's holds."""
    tree: dict[str, Any] = {}
    for path, value in settings.items():
        *branches, leaf = path.split("/")
        here = tree
        for branch in branches:
            here = here.setdefault(branch, {})
        here[leaf] = value
    return tree


def _links(config: BridgeConfig, role: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return where the session listens and where it connects."""
    if role == ROUTER:
        return config.router_listen, config.router.connect
    if config.mode == "client":
        return (), config.connect
    roles = list(config.endpoints)
    listens = role in config.endpoints
    others = roles[: roles.index(role)] if listens else roles
    links = tuple(config.endpoints[other] for other in others) + config.connect
    return ((config.endpoints[role],) if listens else ()), links


def _tls(credentials: Credentials) -> dict[str, Any]:
    key, certificate = str(credentials.key_file), str(credentials.certificate_file)
    return {
        "root_ca_certificate": str(credentials.authority_file),
        "enable_mtls": True,
        "listen_private_key": key,
        "listen_certificate": certificate,
        "connect_private_key": key,
        "connect_certificate": certificate,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
