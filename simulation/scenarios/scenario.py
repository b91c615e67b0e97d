"""A scenario: who, what they want to do, what happens to them, and what must hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from simulation.person.ability import FRAIL, Ability
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.disturbance import Disturbance
from simulation.world.world import Seat, World

Kind = Literal["fall", "non_fall"]


@dataclass(frozen=True, slots=True)
class Wish:
    """From `at_s` on the person wants `intent`."""

    at_s: float
    intent: Intent


@dataclass(frozen=True, slots=True)
class Scenario:
    """One trial; everything random in it was drawn when it was made."""

    title: str
    kind: Kind  # what happens without help: checked, not believed
    family: str  # push, trip, slip, faint, ...; walking, sitting, ...
    size: BodySize
    wishes: tuple[Wish, ...]
    ability: Ability = FRAIL
    disturbances: tuple[Disturbance, ...] = ()
    duration_s: float = 10.0
    seat: Seat | None = None
    seed: int = 0
    checks: tuple[str, ...] = field(default=())  # names of checks that apply, see simulation.scenarios.checks


class Performance:
    """A scenario under way: the world and what the scenario does to it."""

    def __init__(self, scenario: Scenario, *, worn: bool = True) -> None:
        """Set the scene; without the harness (`worn` False) nobody helps."""
        self.scenario = scenario
        self.world = World(scenario.size, scenario.ability, seat=scenario.seat, worn=worn)

    @property
    def disturbed(self) -> bool:
        """Whether anything has happened yet."""
        return any(self.world.time_s >= each.at_s for each in self.scenario.disturbances)

    def advance(self, command: tuple[float, float, float, float]) -> None:
        """Move on by one turn of the person (4 ms) with the walker's commanded velocities."""
        now = self.world.time_s
        intent = Intent()
        for wish in self.scenario.wishes:
            if now >= wish.at_s:
                intent = wish.intent
        for each in self.scenario.disturbances:
            if now >= each.at_s:
                intent = each.act(self.world, intent, now - each.at_s)
        self.world.advance(command, intent)
