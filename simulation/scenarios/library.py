"""The families of scenarios: each draws one person, one deed or one mishap from a generator of random numbers.

Pushes are drawn from the distribution of the 626 that 29 walking people survived in the push-recovery data
(`push_recovery/human-data.csv`): velocity change 0.523 +- 0.103 m/s, duration 0.21 +- 0.04 s, middle at 46 +- 20 % of
the stride, most of them sideways. Those people were young and stayed on their feet, so falls need more: the velocity
change is scaled up until balance is exceeded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from simulation.person.ability import Ability
from simulation.person.anthropometry import HEIGHT_M, MASS_KG, BodySize
from simulation.person.person import Intent
from simulation.scenarios.deed import LeanOn, PickUp, ReachOut, SitDown
from simulation.scenarios.disturbance import AtPhase, Disturbance, Faint, Push, Slip, Stumble, Trip
from simulation.scenarios.scenario import HEALTHY, Kind, Scenario, SensorFaults, Wish
from simulation.world.world import Seat

PUSH_VELOCITY_M_S: Final = (0.523, 0.103)  # mean and standard deviation of the velocity change
PUSH_DURATION_S: Final = (0.21, 0.04)
PUSH_STRIDE: Final = (0.46, 0.20)  # middle of the push in the stride
PUSH_FELLS: Final = (1.6, 3.2)  # times the recorded velocity change, for falls
PUSH_SURVIVED: Final = (0.2, 0.6)

WALKS_S: Final = 1.5  # standing until then
EVENT_S: Final = (4.0, 5.2)
AFTER_FALL_S: Final = 3.5
AFTER_DEED_S: Final = 4.5
FAULTY: Final = 0.1  # share of scenarios in which a sensor errs more than usual
SITTING_BODY: Final = 0.045  # from the seat's top to the hip joint, in body heights: the flesh under the hips
SEAT_EDGE_M: Final = 0.02  # behind where the hips are in standing: the calves all but touch the chair
SEAT_DEPTH_M: Final = 0.45

FALL_CHECKS: Final = ("arrested", "upright walker")
CALM_CHECKS: Final = ("no needless arrest", "upright walker", "on their feet")

Draw = Callable[[np.random.Generator, BodySize, Ability], Scenario]


def draw_person(rng: np.random.Generator) -> tuple[BodySize, Ability]:
    """Return height, weight by way of the body mass index, and how strong the person is."""
    height = float(rng.uniform(*HEIGHT_M))
    mass = float(np.clip(rng.normal(26.0, 4.5) * height**2, *MASS_KG))
    return BodySize(round(height, 3), round(mass, 1)), Ability(strength=round(float(rng.uniform(0.7, 0.9)), 3))


def draw_faults(rng: np.random.Generator, event_s: float) -> SensorFaults:
    """Return healthy sensors mostly; else a camera that is blind for a moment or a force sensor that is off."""
    if rng.random() >= FAULTY:
        return HEALTHY
    if rng.random() < 0.5:
        return SensorFaults(
            blind_from_s=event_s + float(rng.uniform(-0.5, 0.5)), blind_for_s=float(rng.uniform(0.05, 0.12))
        )
    x, y, z = rng.normal(0.0, (8.0, 8.0, 15.0)).tolist()
    return SensorFaults(force_offset_n=(x, y, z))


def _walk(rng: np.random.Generator, slowest: float = 0.3, fastest: float = 1.0) -> tuple[Wish, ...]:
    return (Wish(WALKS_S, Intent(speed_m_s=float(rng.uniform(slowest, fastest)))),)


def _event(rng: np.random.Generator) -> float:
    return float(rng.uniform(*EVENT_S))


def _fall(
    family: str, title: str, size: BodySize, ability: Ability, wishes: tuple[Wish, ...], mishap: Disturbance,
    rng: np.random.Generator, *, lowered_m: float = 0.0,
) -> Scenario:  # fmt: skip
    return Scenario(
        title=title, kind="fall", family=family, size=size, wishes=wishes, ability=ability, disturbances=(mishap,),
        duration_s=round(mishap.at_s + AFTER_FALL_S, 1), seed=int(rng.integers(2**31)),
        faults=draw_faults(rng, mishap.at_s), checks=FALL_CHECKS, lowered_m=lowered_m,
    )  # fmt: skip


def _calm(
    family: str, title: str, size: BodySize, ability: Ability, wishes: tuple[Wish, ...], rng: np.random.Generator,
    deeds: tuple[Disturbance, ...] = (), seat: Seat | None = None, *, lowered_m: float = 0.0,
) -> Scenario:  # fmt: skip
    last = max([wish.at_s for wish in wishes] + [deed.at_s for deed in deeds])
    return Scenario(
        title=title, kind="non_fall", family=family, size=size, wishes=wishes, ability=ability, disturbances=deeds,
        duration_s=round(max(last + AFTER_DEED_S, 8.0), 1), seat=seat, seed=int(rng.integers(2**31)),
        faults=draw_faults(rng, last), checks=CALM_CHECKS, lowered_m=lowered_m,
    )  # fmt: skip


def _push_of(rng: np.random.Generator, size: BodySize, scale: tuple[float, float]) -> tuple[Disturbance, str]:
    change = max(rng.normal(*PUSH_VELOCITY_M_S), 0.17) * rng.uniform(*scale)
    where, direction = (("sideways", 90.0), ("sideways", -90.0), ("from behind", 0.0), ("from the front", 180.0))[
        int(rng.choice(4, p=(0.3, 0.3, 0.2, 0.2)))
    ]
    push = Push(
        at_s=_event(rng), impulse_n_s=float(change * size.mass_kg), direction_deg=float(direction + rng.normal(0, 12)),
        duration_s=float(np.clip(rng.normal(*PUSH_DURATION_S), 0.10, 0.34)),
    )  # fmt: skip
    stride = float(np.clip(rng.normal(*PUSH_STRIDE), 0.0, 0.95))
    return AtPhase(push, stride), f"push of {push.impulse_n_s:.0f} N s {where}"


def push(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """A push beyond what balance can do."""
    mishap, title = _push_of(rng, size, PUSH_FELLS)
    return _fall("push", title, size, ability, _walk(rng), mishap, rng)


def trip(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """An obstacle holds the swinging foot."""
    mishap = Trip(_event(rng), hold_s=float(rng.uniform(0.25, 0.6)), hold_n=float(rng.uniform(300, 900)))
    title = f"trip: foot held for {mishap.hold_s * 1e3:.0f} ms"
    return _fall("trip", title, size, ability, _walk(rng, 0.5), AtPhase(mishap, float(rng.choice((0.15, 0.65)))), rng)


def slip(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Both soles lose their grip."""
    mishap = Slip(_event(rng), lasts_s=float(rng.uniform(0.6, 1.6)), friction=float(rng.uniform(0.01, 0.06)))
    title = f"slip: friction {mishap.friction:.2f} for {mishap.lasts_s:.1f} s"
    return _fall("slip", title, size, ability, _walk(rng, 0.5), mishap, rng)


def faint(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Strength goes away, walking or standing."""
    wishes = _walk(rng) if rng.random() < 0.7 else (Wish(0.0, Intent()),)
    mishap = Faint(_event(rng), fade_s=float(rng.uniform(0.05, 0.30)))
    return _fall("faint", f"faint within {mishap.fade_s * 1e3:.0f} ms", size, ability, wishes, mishap, rng)


def missed_seat(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Sits down where no chair is."""
    down = float(rng.uniform(0.14, 0.22))
    mishap = SitDown(float(rng.uniform(2.5, 3.5)), down + 0.35, float(rng.uniform(1.6, 2.4)))
    title = f"sits down where no chair is, meant to come down {down * 100:.0f} cm"
    return _fall("missed seat", title, size, ability, (Wish(0.0, Intent()),), mishap, rng, lowered_m=down)


def stumble_sideways(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """The swinging foot gets across the standing one."""
    mishap = Stumble(_event(rng), hold_s=float(rng.uniform(0.3, 0.7)), force_n=float(rng.uniform(100, 260)))
    title = f"stumbles sideways: foot dragged across with {mishap.force_n:.0f} N"
    return _fall("sideways stumble", title, size, ability, _walk(rng), mishap, rng)


def walking(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Walks on."""
    wishes = _walk(rng)
    return _calm("walking", f"walks at {wishes[0].intent.speed_m_s:.2f} m/s", size, ability, wishes, rng)


def turning(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Walks a curve."""
    speed, rate = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.15, 0.4) * rng.choice((-1, 1)))
    at = _event(rng)
    wishes = (
        Wish(WALKS_S, Intent(speed_m_s=speed)),
        Wish(at, Intent(speed_m_s=speed, yaw_rate_rad_s=rate)),
        Wish(at + 2.5, Intent(speed_m_s=speed)),
    )
    return _calm("turning", f"turns by {np.degrees(2.5 * rate):.0f} degrees", size, ability, wishes, rng)


def stopping(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Walks, stops, perhaps walks on."""
    wishes = (*_walk(rng), Wish(_event(rng), Intent()))
    if rng.random() < 0.5:
        wishes = (*wishes, Wish(wishes[-1].at_s + 1.5, wishes[0].intent))
    return _calm("stopping", "walks and stops", size, ability, wishes, rng)


def chair(size: BodySize, down_m: float) -> Seat:
    """Return the raised chair behind a standing person that they reach when their hips come down by `down_m`."""
    hips = size.leg_m + size.ankle_height_m
    return Seat(-SEAT_EDGE_M - 0.5 * SEAT_DEPTH_M, hips - down_m - SITTING_BODY * size.height_m, SEAT_DEPTH_M)


def sitting(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Sits down into a raised chair, slowly or fast."""
    down, lasts = float(rng.uniform(0.14, 0.22)), float(rng.uniform(0.7, 1.8))
    seat = chair(size, down)
    deed = SitDown(float(rng.uniform(2.5, 3.5)), down + 0.05, lasts)
    title = f"sits down by {down * 100:.0f} cm in {lasts:.1f} s"
    return _calm("sitting", title, size, ability, (Wish(0.0, Intent()),), rng, (deed,), seat, lowered_m=down)


def picking_up(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Bends down and comes up again."""
    deed = PickUp(
        float(rng.uniform(2.5, 3.5)), bend_rad=float(rng.uniform(0.5, 0.8)), down_m=float(rng.uniform(0.02, 0.08)),
        going_s=float(rng.uniform(0.8, 1.6)),
    )  # fmt: skip
    return _calm("picking up", "bends down to something", size, ability, (Wish(0.0, Intent()),), rng, (deed,))


def reaching(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Reaches for something in front."""
    deed = ReachOut(
        float(rng.uniform(2.5, 3.5)), reach_rad=float(rng.uniform(0.8, 1.6)), bend_rad=float(rng.uniform(0.1, 0.35))
    )
    return _calm("reaching", "reaches out", size, ability, (Wish(0.0, Intent()),), rng, (deed,))


def leaning(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """Puts weight on the bar, standing or walking."""
    wishes = _walk(rng, 0.3, 0.7) if rng.random() < 0.5 else (Wish(0.0, Intent()),)
    deed = LeanOn(_event(rng), float(rng.uniform(50, 150)))
    return _calm("leaning", f"leans on the bar with {deed.force_n:.0f} N", size, ability, wishes, rng, (deed,))


def survived_push(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """A push that balance can do with."""
    deed, title = _push_of(rng, size, PUSH_SURVIVED)
    return _calm("survived push", f"{title}, survived", size, ability, _walk(rng), rng, (deed,))


def survived_trip(rng: np.random.Generator, size: BodySize, ability: Ability) -> Scenario:
    """The foot is held for a moment."""
    deed = Trip(_event(rng), hold_s=float(rng.uniform(0.05, 0.12)), hold_n=float(rng.uniform(100, 300)))
    title = f"foot held for {deed.hold_s * 1e3:.0f} ms, survived"
    return _calm("survived trip", title, size, ability, _walk(rng), rng, (AtPhase(deed, 0.15),))


FAMILIES: Final[dict[Kind, tuple[Draw, ...]]] = {
    "fall": (push, trip, slip, faint, missed_seat, stumble_sideways),
    "non_fall": (
        walking, turning, stopping, sitting, picking_up, reaching, leaning, survived_push, survived_trip,
    ),
}  # fmt: skip
