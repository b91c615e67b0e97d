"""`[personal]`: what `surefoot personalise` may propose to a person."""

from __future__ import annotations

from pydantic import Field

from bridge.config.section import Section


class PersonalConfig(Section):
    """Bounds of the settings that a person is asked to try; `[admittance]` holds the ones in use.

    A setting is proposed if it lies within `span` of the present one and within the bounds of its key, if the walker
    comes to rest soon enough, and if person and walker do not begin to swing: with the loop's delay, rendered mass
    and damping still hold steady a person coupled by a spring of the stiffness below. All values are assumed.
    """

    span: float = Field(default=3.0, ge=1.2, le=10)
    """Greatest ratio between a proposed value and the present one, up and down."""

    coast_max_s: float = Field(default=2.0, gt=0, le=10)
    """Longest time constant M / D with which the walker goes on when the person stops pushing [s]."""

    loop_delay_s: float = Field(default=0.05, gt=0, le=0.5)
    """From a force to the motion it causes: sensor, period and drive together [s]."""

    coupling_stiffness_n_m: float = Field(default=400.0, ge=0, le=10000)
    """Stiffness of padding, harness and the body behind it along the floor [N/m]; 400 need about 20 N s/m."""

    coupling_stiffness_nm_rad: float = Field(default=100.0, ge=0, le=5000)
    """The same about the vertical [N m/rad]."""
