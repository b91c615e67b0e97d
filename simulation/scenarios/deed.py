"""What people do that is no fall and may look like one. Each is a wish: the body carries it out as far as it can."""

from __future__ import annotations

from dataclasses import dataclass, replace

from simulation.person.person import Intent
from simulation.world.world import World

SETTLES_M = 0.06  # lower in wish once on the seat: the trunk's straightening does not lift the weight off it


def gradual(since_s: float, lasts_s: float) -> float:
    """Return 0 before, 1 after, and a smooth rise between: least jerk."""
    u = min(max(since_s / lasts_s, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def there_and_back(since_s: float, going_s: float, staying_s: float) -> float:
    """Return how far along a there-and-back movement is, 0..1."""
    return gradual(since_s, going_s) - gradual(since_s - going_s - staying_s, going_s)


@dataclass(frozen=True, slots=True)
class SitDown:
    """Lowers the hips and bends forward; what meets them, a chair or nothing, is the scenery's affair."""

    at_s: float
    down_m: float
    lasts_s: float = 1.2
    bend_rad: float = 0.6
    back_m: float = 0.12  # by which the weight goes behind the feet, in trust of the chair

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Bend forward, go down and back, straighten up again on the seat."""
        del world
        down = gradual(since_s, self.lasts_s)
        bend = gradual(since_s, 0.9 * self.lasts_s) - 0.8 * gradual(since_s - self.lasts_s, 1.0)
        back = gradual(since_s, self.lasts_s)
        settled = SETTLES_M * gradual(since_s - self.lasts_s, 1.0)
        return replace(
            intent,
            crouch_m=self.down_m * down + settled,
            trunk_pitch_rad=self.bend_rad * bend,
            back_m=self.back_m * back,
            reach_rad=bend,
        )


@dataclass(frozen=True, slots=True)
class PickUp:
    """Bends down to something and comes up again."""

    at_s: float
    bend_rad: float = 0.75
    down_m: float = 0.08
    going_s: float = 1.2
    staying_s: float = 0.6

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Bend, reach down, straighten."""
        del world
        share = there_and_back(since_s, self.going_s, self.staying_s)
        return replace(
            intent, trunk_pitch_rad=self.bend_rad * share, crouch_m=self.down_m * share, reach_rad=0.6 * share
        )


@dataclass(frozen=True, slots=True)
class ReachOut:
    """Lifts the arms to something in front and leans towards it."""

    at_s: float
    reach_rad: float = 1.3
    bend_rad: float = 0.25
    going_s: float = 0.8
    staying_s: float = 1.0

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Reach and come back."""
        del world
        share = there_and_back(since_s, self.going_s, self.staying_s)
        return replace(intent, reach_rad=self.reach_rad * share, trunk_pitch_rad=self.bend_rad * share)


@dataclass(frozen=True, slots=True)
class LeanOn:
    """Puts weight on the walker's bar with the arms."""

    at_s: float
    force_n: float
    going_s: float = 0.6
    staying_s: float = 2.0

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Lean and let go."""
        share = there_and_back(since_s, self.going_s, self.staying_s)
        world.leaning_n = self.force_n * share
        return replace(intent, trunk_pitch_rad=0.15 * share)
