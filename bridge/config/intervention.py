"""`[intervention]`: from the fall-state horizon to risk and stiffening. Reloaded while the controller runs."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from bridge.config.section import Section


class InterventionConfig(Section):
    """Thresholds of the intervention: each cue counts nothing at its onset and fully at its full value.

    The risk of a step is the largest of its cues. `docs/tuning.md` goes through them line by line.
    """

    steps_used: int = Field(default=16, ge=0, le=16)
    """Steps of the horizon that count: 16 all, 1 the present alone; 0: no intervention whatever happens, for trials."""

    distance_onset_sd: float = Field(default=1.5, ge=-20, le=20)
    """Signed distance to the fall boundary below which risk begins [within-class standard deviations]."""

    distance_full_sd: float = Field(default=-0.5, ge=-20, le=20)
    """Signed distance at which the risk is full [within-class standard deviations]; negative is past the boundary."""

    approach_onset_s: float = Field(default=0.8, gt=0, le=10)
    """Time to the boundary (distance over closing rate) below which an approach counts [s]."""

    approach_full_s: float = Field(default=0.3, ge=0, le=10)
    """Time to the boundary at which an approach counts fully [s]."""

    approach_far_sd: float = Field(default=3.5, ge=-20, le=20)
    """Beyond this distance an approach does not count, however fast [within-class standard deviations]."""

    approach_near_sd: float = Field(default=2.0, ge=-20, le=20)
    """Within this distance an approach counts in full [within-class standard deviations]."""

    credible_onset: float = Field(default=0.3, ge=0, le=1)
    """Distance and approach count nothing while the probability of transient and fall together is below this."""

    credible_full: float = Field(default=0.7, ge=0, le=1)
    """From this probability of transient and fall together on, distance and approach count fully."""

    unconfirmed_most: float = Field(default=0.7, ge=0, le=1)
    """Largest risk by distance and approach, unless `probability_full` confirms it; and by a doubtful horizon."""

    probability_onset: float = Field(default=0.2, ge=0, le=1)
    """Probability of fall above which risk begins."""

    probability_full: float = Field(default=0.9, ge=0, le=1)
    """Probability of fall at which the risk is full."""

    trusted_quality: float = Field(default=0.5, ge=0, le=1)
    """A horizon of lower quality is doubtful: it cannot lower the risk, and raises it to `unconfirmed_most` at most."""

    unknown_hold_s: float = Field(default=0.5, ge=0, le=5)
    """How long the last trusted horizon holds [s]; after that the person's state is unknown."""

    unknown_risk: float = Field(default=0.35, ge=0, le=1)
    """Least risk of a person whose state is unknown; above `supervisor.guard_on` it keeps the walker in GUARD."""

    rise_per_s: float = Field(default=8.0, gt=0, le=100)
    """Fastest rise of the stiffening that a risk causes [1/s]; 8 goes from free to stiff in 125 ms."""

    release_per_s: float = Field(default=1.0, gt=0, le=100)
    """Fastest fall of the stiffening [1/s]; slow, so that the walker does not give way under a person."""

    arrest_per_s: float = Field(default=20.0, gt=0, le=200)
    """Rise of the stiffening in ARREST [1/s]; 20 goes from free to stiff in 50 ms."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        ordered = (
            ("distance_full_sd", "distance_onset_sd"),
            ("approach_full_s", "approach_onset_s"),
            ("approach_near_sd", "approach_far_sd"),
            ("credible_onset", "credible_full"),
            ("probability_onset", "probability_full"),
            ("release_per_s", "rise_per_s"),
            ("rise_per_s", "arrest_per_s"),
        )
        for low, high in ordered:
            below, above = getattr(self, low), getattr(self, high)
            equal_allowed = low.endswith("_per_s")
            if below > above or (below == above and not equal_allowed):
                raise ValueError(f"{low} = {below:g} must be below {high} = {above:g}")
        return self
