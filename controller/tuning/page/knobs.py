"""The thresholds as a page shows them: grouped, each with the range its slider covers.

Names, units, bounds and explanations are the config's own (`bridge.config.intervention`); the ranges are those in
which a setting makes sense (docs/tuning.md), somewhat wider. What lies outside can be typed.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from bridge.config.intervention import InterventionConfig


class Knob(NamedTuple):
    """One threshold: `low` to `high` in steps of `step`."""

    key: str
    low: float
    high: float
    step: float

    @property
    def label(self) -> str:
        """The key without the group's word and without the unit."""
        words = self.key.removesuffix(f"_{self.unit}") if self.unit in ("sd", "s") else self.key.removesuffix("_per_s")
        return words.replace("_", " ")

    @property
    def unit(self) -> str:
        """Unit at the name's end, '' for a share."""
        for ending, unit in (("_per_s", "1/s"), ("_sd", "sd"), ("_s", "s")):
            if self.key.endswith(ending):
                return unit
        return ""

    @property
    def meaning(self) -> str:
        """What the config says of it."""
        return " ".join((InterventionConfig.model_fields[self.key].description or "").split())

    def reach(self, value: float) -> tuple[float, float]:
        """Return the slider's ends such that `value` lies between them; a cue is switched off far outside."""
        return min(self.low, value), max(self.high, value)


class Group(NamedTuple):
    """Thresholds that belong together."""

    title: str
    question: str
    knobs: tuple[Knob, ...]


GROUPS: Final = (
    Group(
        "Distance",
        "How near is the fall boundary?",
        (Knob("distance_onset_sd", -2.0, 5.0, 0.1), Knob("distance_full_sd", -4.0, 3.0, 0.1)),
    ),
    Group(
        "Approach",
        "How soon will it be reached?",
        (
            Knob("approach_onset_s", 0.05, 2.0, 0.05),
            Knob("approach_full_s", 0.0, 1.5, 0.05),
            Knob("approach_far_sd", 0.0, 8.0, 0.1),
            Knob("approach_near_sd", -1.0, 6.0, 0.1),
        ),
    ),
    Group(
        "Agreement",
        "What does the classifier say?",
        (
            Knob("credible_onset", 0.0, 1.0, 0.01),
            Knob("credible_full", 0.0, 1.0, 0.01),
            Knob("unconfirmed_most", 0.0, 1.0, 0.01),
        ),
    ),
    Group(
        "Probability",
        "How likely is a fall?",
        (Knob("probability_onset", 0.0, 1.0, 0.01), Knob("probability_full", 0.0, 1.0, 0.01)),
    ),
    Group(
        "Not knowing",
        "What while the horizon cannot be trusted?",
        (
            Knob("trusted_quality", 0.0, 1.0, 0.01),
            Knob("unknown_hold_s", 0.0, 5.0, 0.1),
            Knob("unknown_risk", 0.0, 1.0, 0.01),
        ),
    ),
    Group(
        "Rates",
        "How fast may the walker change under a person?",
        (
            Knob("rise_per_s", 0.5, 40.0, 0.5),
            Knob("release_per_s", 0.1, 5.0, 0.1),
            Knob("arrest_per_s", 1.0, 60.0, 0.5),
        ),
    ),
    Group("Reach", "How far ahead counts?", (Knob("steps_used", 0, 16, 1),)),
)
KNOBS: Final = {knob.key: knob for group in GROUPS for knob in group.knobs}
