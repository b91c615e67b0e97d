"""A scenario: who, what they want to do, what happens to them, and what must hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from simulation.mocap.clip import Clip
from simulation.mocap.follow import Follower
from simulation.mocap.retarget import retarget
from simulation.person.ability import FRAIL, Ability
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.scenarios.disturbance import AtPhase, Disturbance
from simulation.world.parameters import HarnessParameters
from simulation.world.world import Seat, World

Kind = Literal["fall", "non_fall"]


@dataclass(frozen=True, slots=True)
class Wish:
    """From `at_s` on the person wants `intent`."""

    at_s: float
    intent: Intent


@dataclass(frozen=True, slots=True)
class SensorFaults:
    """What is wrong with the sensors in a scenario."""

    blind_from_s: float = 0.0
    blind_for_s: float = 0.0  # the detector finds nobody
    force_offset_n: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the force sensor, forward, left, up

    def blind(self, time_s: float) -> bool:
        """Whether the detector finds nobody at `time_s`."""
        return 0.0 <= time_s - self.blind_from_s < self.blind_for_s


HEALTHY: Final = SensorFaults()
SLACK_M: Final = HarnessParameters().slack_down_m


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
    faults: SensorFaults = HEALTHY
    checks: tuple[str, ...] = ()  # names of checks that must hold, see simulation.campaign.checks
    clip: Clip | None = None  # what the person does until the first disturbance, from the end of the waiting on
    lowered_m: float = 0.0  # how far the person means to come down: a fall's drop counts from there


class Performance:
    """A scenario under way: the world and what the scenario does to it."""

    def __init__(self, scenario: Scenario, *, worn: bool = True, slack_m: float = SLACK_M) -> None:
        """Set the scene; without the harness (`worn` False) nobody helps, with it straps bear beyond `slack_m`."""
        self.scenario = scenario
        harness = HarnessParameters(slack_down_m=slack_m)
        self.world = World(scenario.size, scenario.ability, harness=harness, seat=scenario.seat, worn=worn)
        self._track = None if scenario.clip is None else retarget(scenario.clip, scenario.size)
        self.follower: Follower | None = None  # who drives the person along the clip
        self.waiting = False  # while True the person stands and nothing begins
        self._begin_s = 0.0
        self.watchers: list[Callable[[World], None]] = []  # called after every turn
        self._began_s: list[float | None] = [None] * len(scenario.disturbances)

    @property
    def time_s(self) -> float:
        """Time since the scenario began [s]."""
        return self.world.time_s - self._begin_s

    @property
    def disturbed_s(self) -> float | None:
        """When the first disturbance began [s]; None before it."""
        return min((began for began in self._began_s if began is not None), default=None)

    def advance(self, command: tuple[float, float, float, float]) -> None:
        """Move on by one turn of the person (4 ms) with the walker's commanded velocities."""
        if self.waiting:
            self.world.advance(command, Intent())
            self._begin_s = self.world.time_s
            return
        now = self.time_s
        intent = Intent()
        for wish in self.scenario.wishes:
            if now >= wish.at_s:
                intent = wish.intent
        for index, each in enumerate(self.scenario.disturbances):
            began = self._began_s[index]
            if (
                began is None
                and now >= each.at_s
                and (not isinstance(each, AtPhase) or each.ready(self.world, now - each.at_s))
            ):
                began = self._began_s[index] = now
            if began is not None:
                intent = each.act(self.world, intent, now - began)
        if self._track is not None and self.follower is None:
            until_s = min((each.at_s for each in self.scenario.disturbances), default=self._track.duration_s)
            self.follower = Follower(self.world, self._track, until_s)
            self.world.drive = self.follower.act
        self.world.advance(command, intent)
        for watcher in self.watchers:
            watcher(self.world)
