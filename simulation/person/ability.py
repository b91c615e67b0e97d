"""What a person can do for their balance; an old or ill person can do less."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Ability:
    """Limits of balance. The defaults are those of a frail person; all values are assumed."""

    strength: float = 0.8  # share of the table's joint torques that is there
    reaction_s: float = 0.15  # before a step is redirected after what was felt
    step_forward: float = 0.42  # longest step ahead of the standing foot [body heights]
    step_back: float = 0.15  # longest step back [body heights]
    step_wide: float = 0.22  # widest step [body heights]
    step_narrow: float = 0.06  # narrowest step: feet do not cross [body heights]
    shortest_step_s: float = 0.40  # a hurried step takes at least this
    trunk_moment_nm: float = 70.0  # to keep the trunk upright, for 70 kg
    give_up_tilt_rad: float = 1.0  # trunk tilt beyond which nothing is tried any more


STURDY = Ability(
    strength=1.0, reaction_s=0.10, step_forward=0.45, step_back=0.30, step_wide=0.30, shortest_step_s=0.32,
    trunk_moment_nm=90.0,
)  # fmt: skip
FRAIL = Ability()
