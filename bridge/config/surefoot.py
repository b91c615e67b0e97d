"""The whole configuration: one section per part."""

from __future__ import annotations

from bridge.config.bridge import BridgeConfig
from bridge.config.launch import LaunchConfig
from bridge.config.section import Section


class SurefootConfig(Section):
    """Everything `config/surefoot.toml` may say; every section and key is optional."""

    bridge: BridgeConfig = BridgeConfig()
    """The wire."""

    launch: LaunchConfig = LaunchConfig()
    """The processes."""
