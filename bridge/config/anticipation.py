"""`[anticipation]`: from a window of keypoints to the fall-state horizon."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class QualityConfig(Section):
    """`[anticipation.quality]`: what makes the input less reliable; each factor falls from 1 to 0 along a line."""

    measured_share_full: float = Field(default=0.85, gt=0, le=1)
    """Share of measured keypoints in the window (a filled one counts half) from which nothing is missing."""
    measured_share_zero: float = Field(default=0.35, ge=0, lt=1)
    """Share at and below which the quality is 0."""
    strangeness_full: float = Field(default=1.0, gt=0, le=10)
    """Distance from the training poses up to which a pose counts as seen; 3 % of those are beyond 1."""
    strangeness_zero: float = Field(default=2.5, gt=0, le=100)
    """Distance at and beyond which the quality is 0. The strangest third of the window is judged."""
    several_people: float = Field(default=0.6, ge=0, le=1)
    """Factor while the detector sees more than one person."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.measured_share_zero < self.measured_share_full:
            raise ValueError("measured_share_zero must be less than measured_share_full")
        if not self.strangeness_full < self.strangeness_zero:
            raise ValueError("strangeness_full must be less than strangeness_zero")
        return self


class AnticipationConfig(Section):
    """`[anticipation]`: the networks, and which input is too poor to be used."""

    checkpoint: str = ""
    """Path of the checkpoint (`.safetensors`), or the name of weights that come with the package: "" = "default", which
    know filmed people; "simulated" know people in the simulator's harness too, and what they call a fall begins earlier
    (docs/simulation.md)."""
    forecaster: Literal["checkpoint", "zero_velocity", "constant_velocity"] = "checkpoint"
    """Forecast of the motion: the checkpoint's own, or one of the two that need no learning."""
    threads: int = Field(default=1, ge=1, le=64)
    """Threads of a network step; more than one costs latency on a busy machine."""
    max_gap_s: float = Field(default=0.1, ge=0, le=0.4)
    """Missing ticks up to this long are filled along a line; after a longer gap the window starts anew."""
    hold_s: float = Field(default=1.0, ge=0, le=10)
    """A lost keypoint is held at its last place relative to the body for this long, then at the average place."""
    min_keypoints: int = Field(default=6, ge=2, le=12)
    """With fewer keypoints than this in the newest frame there is no horizon."""
    min_body_length_px: float = Field(default=16.0, gt=0, le=1000)
    """A person who looks smaller than this is too far away: the detector's noise would be larger than the motion."""
    min_quality: float = Field(default=0.05, ge=0, le=1)
    """Below this quality the horizon is declared invalid."""
    max_centre_speed_body_lengths_s: float = Field(default=3.0, ge=0, le=20)
    """Bound on the speed at which the foreseen body moves through the image."""
    quality: QualityConfig = QualityConfig()
    """What makes the input less reliable."""
