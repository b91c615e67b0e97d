"""Counting: falls that were caught, how long before the impact, and interventions that nobody needed.

An *intervention* is an entry into ARREST, or, on request, into GUARD or ARREST. A fall is *caught* when an intervention
that began before the impact was not let go until the impact; its *lead* is the time between the two. What begins in
a fall, from `EARLY_S` before its onset until it is over, is about that fall; every other intervention is *needless*.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bridge.clock import NS
from controller.tuning.cases import Case, Fall
from controller.tuning.replay import ARREST, DISARMED, FOLLOW, GUARD, RECOVER, SAFE_STOP, Run

EARLY_S: Final = 0.5  # what begins so long before a fall is foresight: the horizon's own reach
HELD: Final = 0.5  # a support in RECOVER that is softer has been let go
NAN: Final = float("nan")


class Intervening(StrEnum):
    """What counts as an intervention."""

    ARREST = "arrest"
    GUARD = "guard"  # or more


class FallOutcome(NamedTuple):
    """How one fall went."""

    fall: Fall
    caught: bool
    lead_s: float  # from the intervention to the impact; NaN when not caught
    late_s: float  # from the impact to the first intervention after it; NaN when caught, or there was none
    watched: bool  # the system was armed and saw something before the impact


class Tally(NamedTuple):
    """The counts of one case."""

    name: str
    group: str
    falls: tuple[FallOutcome, ...]
    needless_s: tuple[float, ...]  # when each began
    hours: float  # watched, outside of falls


class Outcome(NamedTuple):
    """The counts of several cases."""

    falls: int
    caught: int
    unwatched: int  # falls before which the system was not armed; among the missed
    leads_s: tuple[float, ...]  # of the caught, in order of the cases
    needless: int
    hours: float

    @property
    def caught_share(self) -> float:
        """Share of the falls that were caught; NaN without falls."""
        return self.caught / self.falls if self.falls else NAN

    @property
    def lead_median_s(self) -> float:
        """Median lead of the caught falls [s]; NaN without."""
        return float(np.median(self.leads_s)) if self.leads_s else NAN

    @property
    def per_hour(self) -> float:
        """Needless interventions per watched hour; NaN without any such time."""
        return self.needless / self.hours if self.hours > 0.0 else NAN


def score_one(run: Run, by: Intervening = Intervening.ARREST) -> Tally:
    """Return the counts of one case."""
    case, state = run.case, run.state
    acting = (state == ARREST) | (state == GUARD if by is Intervening.GUARD else False)
    let_go = (state == FOLLOW) | (state == DISARMED) | ((state == RECOVER) & (run.stiffening < HELD))
    begins = np.flatnonzero(acting & ~np.append(False, acting[:-1]))
    within = in_falls(case)
    needless = begins[~within[begins]]
    period_s = case.period_ns / NS
    watched = ~within & (state != DISARMED) & (state != SAFE_STOP)
    return Tally(
        case.name,
        case.group,
        tuple(_judge(case, fall, acting, let_go, state != DISARMED) for fall in case.falls),
        tuple((needless * period_s).tolist()),
        float(np.count_nonzero(watched)) * period_s / 3600.0,
    )


def total(tallies: Iterable[Tally]) -> Outcome:
    """Return the counts of several cases together."""
    tallies = list(tallies)
    falls = [outcome for tally in tallies for outcome in tally.falls]
    return Outcome(
        len(falls),
        sum(outcome.caught for outcome in falls),
        sum(not outcome.watched for outcome in falls),
        tuple(outcome.lead_s for outcome in falls if outcome.caught),
        sum(len(tally.needless_s) for tally in tallies),
        float(sum(tally.hours for tally in tallies)),
    )


def score(runs: Iterable[Run], by: Intervening = Intervening.ARREST) -> Outcome:
    """Return the counts of several runs together."""
    return total(score_one(run, by) for run in runs)


def in_falls(case: Case) -> NDArray[np.bool_]:
    """Return for each turn whether it belongs to a fall, (T,)."""
    within, times_s = np.zeros(case.ticks, np.bool_), case.times_s
    for fall in case.falls:
        within |= (times_s >= fall.onset_s - EARLY_S) & (times_s < fall.over_s)
    return within


def _judge(
    case: Case, fall: Fall, acting: NDArray[np.bool_], let_go: NDArray[np.bool_], armed: NDArray[np.bool_]
) -> FallOutcome:
    period_s = case.period_ns / NS
    first = _turn(case, fall.onset_s - EARLY_S)
    impact = _turn(case, fall.impact_s)  # the first turn that is too late
    end = _turn(case, fall.over_s)
    dropped = np.flatnonzero(let_go[first:impact])
    since = first + int(dropped[-1]) + 1 if len(dropped) else first  # from here on the support was not let go
    holding = np.flatnonzero(acting[since:impact])
    watched = bool(armed[first:impact].any())
    if len(holding):
        return FallOutcome(fall, True, fall.impact_s - (since + int(holding[0])) * period_s, NAN, watched)
    late = np.flatnonzero(acting[impact:end])
    late_s = (impact + int(late[0])) * period_s - fall.impact_s if len(late) else NAN
    return FallOutcome(fall, False, NAN, late_s, watched)


def _turn(case: Case, time_s: float) -> int:
    """Return the first turn at or after `time_s`."""
    if time_s == float("inf"):
        return case.ticks
    return min(max(int(np.ceil(time_s * NS / case.period_ns - 1e-6)), 0), case.ticks)
