"""Counts and interventions in words, as the page says them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from bridge.messages import GaitState
from controller.tuning.cases import Case
from controller.tuning.confidence import poisson, wilson
from controller.tuning.page.tradeoff_chart import Point
from controller.tuning.replay import Run
from controller.tuning.score import Outcome, Tally

SHOWN: Final = (GaitState.GUARD, GaitState.ARREST, GaitState.SAFE_STOP)
SAME_S: Final = 1e-6


class Happening(NamedTuple):
    """One line of the list under the timeline."""

    time_s: float
    state: str  # '' for a fall
    what: str
    verdict: str  # 'needless', 'caught', 'missed' or ''


def happenings(run: Run, tally: Tally) -> list[Happening]:
    """Return each change into GUARD, ARREST and SAFE_STOP with its reason, and each fall, in order of time."""
    caught = {fall.fall.impact_s - fall.lead_s: fall for fall in tally.falls if fall.caught}
    lines = []
    for change in run.transitions:
        if change.after not in SHOWN:
            continue
        verdict, what = "", change.reason
        if any(abs(change.time_s - time_s) < SAME_S for time_s in tally.needless_s):
            verdict = "needless"
        elif any(abs(change.time_s - time_s) < SAME_S for time_s in caught):
            verdict = "caught"
        lines.append(Happening(change.time_s, change.after.value, what, verdict))
    for fall in tally.falls:
        impact = f"impact at {fall.fall.impact_s:.2f} s"
        if fall.caught:
            lines.append(Happening(fall.fall.onset_s, "", f"fall begins, {impact}", ""))
            continue
        late = f"{fall.late_s:.2f} s too late" if math.isfinite(fall.late_s) else "nothing came"
        unseen = "" if fall.watched else ", not armed before it"
        lines.append(Happening(fall.fall.onset_s, "", f"fall begins, {impact}: {late}{unseen}", "missed"))
    return sorted(lines, key=lambda line: line.time_s)


def case_words(case: Case) -> str:
    """Return what a recording is: its name, its length, and whether somebody falls."""
    falls = len(case.falls)
    kind = "no label" if not case.labelled else "no fall" if not falls else "fall" if falls == 1 else f"{falls} falls"
    return f"{case.name} · {duration_words(case.duration_s)} · {kind}"


def duration_words(duration_s: float) -> str:
    """Return a duration in the unit one would say it in."""
    if duration_s < 90.0:
        return f"{duration_s:.1f} s"
    return f"{duration_s / 60.0:.1f} min" if duration_s < 5400.0 else f"{duration_s / 3600.0:.1f} h"


def caught_words(outcome: Outcome) -> str:
    """Return how many falls were caught; without a fall, that there is none."""
    return f"{outcome.caught} of {outcome.falls}" if outcome.falls else "no fall"


def lead_words(outcome: Outcome) -> str:
    """Return the median lead."""
    return f"{outcome.lead_median_s * 1e3:.0f} ms" if outcome.leads_s else "–"


def needless_words(outcome: Outcome) -> str:
    """Return how many interventions were needless, in how much time."""
    return f"{outcome.needless} in {duration_words(outcome.hours * 3600.0)}"


def share_words(outcome: Outcome) -> str:
    """Return what the falls caught say about falls to come: a 95 % interval."""
    share = wilson(outcome.caught, outcome.falls)
    return f"95 %: {100.0 * share.low:.0f} to {100.0 * share.high:.0f} %" if outcome.falls else ""


def rate_words(outcome: Outcome) -> str:
    """Return the needless interventions per hour with a 95 % interval."""
    rate = poisson(outcome.needless, outcome.hours)
    if not math.isfinite(rate.value):
        return "no time to count in"
    return f"{rate.value:.3g} per hour, 95 %: {rate.low:.3g} to {rate.high:.3g}"


def point(name: str, outcome: Outcome | None) -> Point:
    """Return `outcome` as a point of the trade-off; None: nothing is known yet."""
    if outcome is None:
        return Point(name, math.nan, math.nan, math.nan, "")
    words = f"{caught_words(outcome)} caught, lead {lead_words(outcome)}, needless {needless_words(outcome)}"
    return Point(name, outcome.caught_share, outcome.lead_median_s, outcome.per_hour, words)


def verdicts(tallies: Sequence[Tally]) -> tuple[set[str], set[str]]:
    """Return the names of the recordings with a missed fall, and of those with a needless intervention."""
    missed = {tally.name for tally in tallies if any(not fall.caught for fall in tally.falls)}
    needless = {tally.name for tally in tallies if tally.needless_s}
    return missed, needless
