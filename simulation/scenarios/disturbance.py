"""What throws people over: each is a force or a loss, never a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, exp, radians, sin
from typing import Final, Protocol

import numpy as np

from bridge.messages import Floats
from simulation.person.person import Intent
from simulation.world.world import World

SLIPPERY: Final = 0.04  # friction of a wet sole


class Disturbance(Protocol):
    """Something that happens in a scenario."""

    @property
    def at_s(self) -> float:
        """When it begins [s]."""
        ...

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Do to `world` what is to be done `since_s` after the beginning; return what the person wants now."""
        ...


@dataclass(frozen=True, slots=True)
class AtPhase:
    """Waits with `what` for a moment of the gait: the next time, after `what.at_s`, that the stride has got so far."""

    what: Disturbance
    stride: float  # share of the stride from the touchdown of the left foot, 0..1
    patience_s: float = 1.5  # then it happens anyway

    @property
    def at_s(self) -> float:
        """When the waiting begins [s]."""
        return self.what.at_s

    def ready(self, world: World, waited_s: float) -> bool:
        """Whether the moment has come, after waiting for it for `waited_s`."""
        person = world.person
        done = 0.5 * (person.phase + (0.0 if person.stance == "l" else 1.0))
        return waited_s > self.patience_s or 0.0 <= done - self.stride < 0.1

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Let it happen."""
        return self.what.act(world, intent, since_s)


@dataclass(frozen=True, slots=True)
class Push:
    """A push at the trunk."""

    at_s: float
    impulse_n_s: float
    direction_deg: float = 90.0  # as the person faces: 0 from behind, 90 to the left
    duration_s: float = 0.2

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Push for as long as it lasts."""
        if since_s < self.duration_s:
            angle = radians(self.direction_deg) + world.person.heading_rad
            force = self.impulse_n_s / self.duration_s
            world.disturbing.append((world.person.torso, _force(force * cos(angle), force * sin(angle))))
        return intent


@dataclass(frozen=True, slots=True)
class Trip:
    """An obstacle that holds the swinging foot back: the next one that swings after `at_s`."""

    at_s: float
    hold_s: float = 0.30
    hold_n: float = 500.0
    hold_ns_m: float = 1200.0

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Hold the swing foot against its motion."""
        person = world.person
        if since_s < self.hold_s and person.swinging and 0.25 < person.phase < 0.8:
            foot = person.foot[person.swing]
            world.disturbing.append((foot, _force(*_braking(world, foot, self.hold_ns_m, self.hold_n))))
        return intent


@dataclass(frozen=True, slots=True)
class Stumble:
    """The swinging foot is dragged over to the other side: the legs cross and the body falls sideways."""

    at_s: float
    hold_s: float = 0.45
    force_n: float = 150.0

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Pull the swing foot towards and past the standing one."""
        person = world.person
        if since_s < self.hold_s and person.swinging:
            inward = -self.force_n if person.swing == "l" else self.force_n
            heading = person.heading_rad
            pull = _force(-sin(heading) * inward, cos(heading) * inward)
            world.disturbing.append((person.foot[person.swing], pull))
        return intent


@dataclass(frozen=True, slots=True)
class Slip:
    """The floor under the soles turns slippery, for both or for the foot that stands at `at_s`."""

    at_s: float
    lasts_s: float = 1.0
    friction: float = SLIPPERY

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Change the friction of the soles and back."""
        world.set_sole_friction(self.friction if since_s < self.lasts_s else None)
        return intent


@dataclass(frozen=True, slots=True)
class Faint:
    """Strength fades within a fifth of a second and stays away."""

    at_s: float
    fade_s: float = 0.05

    def act(self, world: World, intent: Intent, since_s: float) -> Intent:
        """Let the effort fade."""
        del world
        effort = intent.effort * exp(-since_s / self.fade_s)
        return replace(intent, effort=effort if effort > 0.02 else 0.0)


def _force(x: float, y: float) -> Floats:
    return np.array([x, y, 0.0, 0.0, 0.0, 0.0])


def _braking(world: World, body: int, damping: float, most: float) -> tuple[float, float]:
    vx, vy, _ = world.velocity_of(body)
    size = float(np.hypot(vx, vy))
    if size < 1e-6:
        return 0.0, 0.0
    pull = min(damping * size, most)
    return -pull * vx / size, -pull * vy / size
