"""A wire for one run alone, so that it disturbs no robot and no other run on this machine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from bridge.config.load import load_config
from bridge.launch.ports import free_ports


def private_wire(config: Path | None, overrides: Sequence[str], roles: Sequence[str], name: str) -> list[str]:
    """Return overrides that give `roles` a namespace and free ports of the loopback to themselves, and no router.

    Where `bridge.keys` is set the endpoints are TLS, because no others are accepted then.

    Args:
        config: TOML file; None means the defaults.
        overrides: `section.key=value` on top of it.
        roles: who takes part; each of them runs here, wherever the configuration has it.
        name: what the namespace begins with.

    Raises:
        ConfigError: the configuration does not hold.
    """
    protocol = "tls" if load_config(config, overrides).bridge.keys else "tcp"
    places = zip(roles, free_ports(len(roles)), strict=True)
    return [
        f'bridge.namespace="{name}-{os.getpid()}"',
        "bridge.mode=peer",
        "bridge.connect=[]",
        *(f"bridge.endpoints.{role}={protocol}/127.0.0.1:{port}" for role, port in places),
    ]
