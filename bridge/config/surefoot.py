"""The whole configuration: one section per part."""

from __future__ import annotations

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
from bridge.config.section import Section
from bridge.config.simulation import SimulationConfig
from bridge.config.supervisor import SupervisorConfig
from bridge.config.walker import WalkerConfig


class SurefootConfig(Section):
    """Everything `config/surefoot.toml` may say; every section and key is optional."""

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

    mpc: MpcConfig = MpcConfig()
    """Horizon, weights and solver of the controller."""

    gate: GateConfig = GateConfig()
    """What no command may exceed."""

    drive: DriveConfig = DriveConfig()
    """The drive without a robot."""

    simulation: SimulationConfig = SimulationConfig()
    """The world when there is no robot."""
