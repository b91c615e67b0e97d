"""The whole configuration: one section per part."""

from __future__ import annotations

from pydantic import Field

from bridge.config.admittance import AdmittanceConfig
from bridge.config.anticipation import AnticipationConfig
from bridge.config.bridge import BridgeConfig
from bridge.config.controller import ControllerConfig
from bridge.config.drive import DriveConfig
from bridge.config.gate import GateConfig
from bridge.config.inputs import InputsConfig
from bridge.config.intervention import InterventionConfig
from bridge.config.launch import LaunchConfig
from bridge.config.mpc import MpcConfig
from bridge.config.perception import PerceptionConfig
from bridge.config.personal import PersonalConfig
from bridge.config.section import Section
from bridge.config.simulation import SimulationConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.config.version import VERSION
from bridge.config.walker import WalkerConfig


class SurefootConfig(Section):
    """Everything `config/surefoot.toml` may say; every section and key is optional."""

    version: int = Field(default=VERSION, ge=VERSION, le=VERSION)
    """Of this file's keys, not of Surefoot. Leave it: `surefoot config --migrate` brings an old file up to date."""

    bridge: BridgeConfig = BridgeConfig()
    """The wire."""

    inputs: InputsConfig = InputsConfig()
    """What readers hold their inputs to."""

    launch: LaunchConfig = LaunchConfig()
    """The processes."""

    perception: PerceptionConfig = PerceptionConfig()
    """Camera, video or recording in, twelve clean keypoints out."""

    anticipation: AnticipationConfig = AnticipationConfig()
    """From a window of keypoints to the fall-state horizon."""

    intervention: InterventionConfig = InterventionConfig()
    """From the fall-state horizon to risk and stiffening; reloaded while running."""

    supervisor: SupervisorConfig = SupervisorConfig()
    """When the states of the intervention change."""

    controller: ControllerConfig = ControllerConfig()
    """The control loop."""

    walker: WalkerConfig = WalkerConfig()
    """Masses, sizes and limits of the walker."""

    admittance: AdmittanceConfig = AdmittanceConfig()
    """What the person feels at the interface."""

    personal: PersonalConfig = PersonalConfig()
    """What `surefoot personalise` may propose to a person."""

    mpc: MpcConfig = MpcConfig()
    """Horizon, weights and solver of the controller."""

    gate: GateConfig = GateConfig()
    """What no command may exceed."""

    drive: DriveConfig = DriveConfig()
    """The drive without a robot."""

    simulation: SimulationConfig = SimulationConfig()
    """The world when there is no robot."""
