"""The whole study: settings tried, one chosen for the budget, and judged on recordings that had no say in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from bridge.config.intervention import InterventionConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from controller.tuning.cases import Case
from controller.tuning.choose import choose, pareto
from controller.tuning.confidence import Bootstrap, Interval, bootstrap, hours_needed, poisson, rate_bound, wilson
from controller.tuning.course import Stages
from controller.tuning.evaluate import Evaluator
from controller.tuning.folds import folds
from controller.tuning.reference import replay_live
from controller.tuning.replay import replay
from controller.tuning.score import Intervening, Outcome, Tally, total
from controller.tuning.search import Tried, search_grid, search_study, simplify
from controller.tuning.space import Setting, Space

CHECKED_S: Final = 120.0  # recording that the chosen setting is replayed on with the code that runs live

Told = Callable[[str, float], None]  # what is being done, and how much more of it is, of 1


class Question(NamedTuple):
    """What is asked of a study."""

    budget_per_hour: float
    method: str  # 'grid' or 'study'
    space: Space
    trials: int = 200  # of a study
    folds: int = 5
    by: Intervening = Intervening.ARREST
    seed: int = 0
    jobs: int = 1


class Judged(NamedTuple):
    """A setting with its counts on every recording."""

    setting: Setting  # what differs from the file; empty: the present values
    config: InterventionConfig
    tallies: tuple[Tally, ...]
    outcome: Outcome


class Fold(NamedTuple):
    """A setting chosen without some recordings, and what it did on these."""

    setting: Setting
    within: bool
    chosen_on: Outcome
    held_out: Outcome


@dataclass(frozen=True, slots=True)
class Answer:
    """What a study found."""

    question: Question
    cases: tuple[Case, ...]
    tried: int
    present: Judged
    recommended: Judged
    within: bool  # whether the recommended setting keeps the budget on these recordings
    front: tuple[Judged, ...]  # settings that none beats, fewest needless interventions first
    every: tuple[Outcome, ...]  # of all settings tried
    folds: tuple[Fold, ...]  # empty where there are too few recordings to hold any out
    held_out: Outcome | None  # of all folds together
    resampled: Bootstrap  # of the recommended setting on all recordings
    caught: Interval  # share of falls caught by the recommended setting, Wilson
    needless: Interval  # needless interventions per hour, held out where possible, Poisson
    bound_per_hour: float  # not exceeded with 95 % confidence, held out where possible
    hours_needed: float  # without any needless intervention, to show that the budget is kept

    @property
    def judged(self) -> Outcome:
        """The counts that the budget is judged by: held out where that was possible."""
        return self.recommended.outcome if self.held_out is None else self.held_out

    @property
    def supported(self) -> bool:
        """Whether the recordings show, with 95 % confidence, that the budget is kept."""
        return self.bound_per_hour <= self.question.budget_per_hour


def recommend(
    cases: Sequence[Case], config: SurefootConfig, question: Question, told: Told = lambda _what, _share: None
) -> Answer:
    """Return the answer to `question`; the same arguments give the same answer, whatever `jobs` is.

    Raises:
        SurefootError: the cases are without any fall and without any time that could tell of needless interventions.
    """
    present, stages = config.intervention, Stages(config.mpc.stages, config.mpc.stage_s)
    with Evaluator(cases, config.supervisor, stages, question.by, question.jobs) as evaluator:
        every = list(range(len(cases)))
        tried = _search(question, present, evaluator, every, lambda share: told("trying settings", share))
        outcomes = tried.outcomes(every)
        if not outcomes[0].falls and not outcomes[0].hours:
            raise SurefootError("nothing to tune on: in these recordings nobody falls and nothing is watched")
        chosen = choose(outcomes, question.budget_per_hour, _change(question, tried, present))
        held = _hold_out(cases, question, present, evaluator, tried, told)
        best = simplify(tried, chosen.number, present, evaluator, every)
    held_out = _together(held) if held else None
    recommended, outcomes, change = _judged(tried, best), tried.outcomes(every), _change(question, tried, present)
    _check(cases, config, recommended.config, stages)
    judged = recommended.outcome if held_out is None else held_out
    return Answer(
        question=question,
        cases=tuple(cases),
        tried=len(tried.settings),
        present=_judged(tried, 0),
        recommended=recommended,
        within=chosen.within,
        front=tuple(_judged(tried, number) for number in pareto(outcomes, change)),
        every=tuple(outcomes),
        folds=tuple(held),
        held_out=held_out,
        resampled=bootstrap(recommended.tallies, question.seed),
        caught=wilson(recommended.outcome.caught, recommended.outcome.falls),
        needless=poisson(judged.needless, judged.hours),
        bound_per_hour=rate_bound(judged.needless, judged.hours),
        hours_needed=hours_needed(0, question.budget_per_hour),
    )


def _search(
    question: Question,
    present: InterventionConfig,
    evaluator: Evaluator,
    chosen_on: Sequence[int],
    told: Callable[[float], None],
) -> Tried:
    if question.method == "grid":
        return search_grid(question.space, present, evaluator, told)
    return search_study(question.space, present, evaluator, chosen_on, question.trials, question.seed, told)


def _hold_out(
    cases: Sequence[Case],
    question: Question,
    present: InterventionConfig,
    evaluator: Evaluator,
    tried: Tried,
    told: Told,
) -> list[Fold]:
    """Choose again without each fold in turn; what a study may look at is held out too."""
    fold_of = folds(cases, question.folds, question.seed)
    count = max(fold_of) + 1
    if count < 2:
        return []
    held: list[Fold] = []
    for fold in range(count):
        inside = [i for i, of in enumerate(fold_of) if of != fold]
        outside = [i for i, of in enumerate(fold_of) if of == fold]
        known = tried
        if question.method != "grid":  # every setting of a grid is tried anyway
            what = f"holding out part {fold + 1} of {count}"
            known = _search(question, present, evaluator, inside, partial(told, what))
        known = Tried(
            list(known.settings), list(known.configs), list(known.tallies)
        )  # what is added here is of this fold alone
        chosen = choose(known.outcomes(inside), question.budget_per_hour, _change(question, known, present))
        best = simplify(known, chosen.number, present, evaluator, inside)
        row = known.tallies[best]
        held.append(
            Fold(known.settings[best], chosen.within, total(row[i] for i in inside), total(row[i] for i in outside))
        )  # fmt: skip
    return held


def _change(question: Question, tried: Tried, present: InterventionConfig) -> list[float]:
    return [question.space.change(setting, present) for setting in tried.settings]


def _together(held: Sequence[Fold]) -> Outcome:
    parts = [fold.held_out for fold in held]
    return Outcome(
        sum(part.falls for part in parts),
        sum(part.caught for part in parts),
        sum(part.unwatched for part in parts),
        tuple(lead for part in parts for lead in part.leads_s),
        sum(part.needless for part in parts),
        sum(part.hours for part in parts),
    )


def _judged(tried: Tried, number: int) -> Judged:
    row = tried.tallies[number]
    return Judged(tried.settings[number], tried.configs[number], row, total(row))


def _check(cases: Sequence[Case], config: SurefootConfig, chosen: InterventionConfig, stages: Stages) -> None:
    """Hold the replay of the chosen setting against the code that runs live, falls first, for a bounded time."""
    left_s = CHECKED_S
    for case in sorted(cases, key=lambda case: not case.falls):
        left_s -= case.duration_s
        if left_s < 0.0:
            return
        quick = replay(case, chosen, config.supervisor, stages).transitions
        if quick != replay_live(case, chosen, config.supervisor, stages).transitions:
            raise RuntimeError(f"{case.name}: the replay and the controller's own code disagree; please report this")
