"""A whole study: the same answer however many work on it, honest about what it was not chosen on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from controller_tuning_streams import watched

from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SurefootError
from controller.tuning.cases import Case, Fall
from controller.tuning.course import Stages
from controller.tuning.evaluate import Evaluator
from controller.tuning.recommend import Answer, Question, recommend
from controller.tuning.replay import replay
from controller.tuning.score import score_one
from controller.tuning.space import GRID, ORDERED, STUDY, configured, ordered, parse_space
from controller.tuning.words import findings, notes, rows

CONFIG = SurefootConfig()


def days(seed: int = 0, falls: int = 6, calm: int = 6) -> list[Case]:
    """Falls that are seen with a probability that rises to 0.95 and on, and days on which it comes to 0.6."""
    rng = np.random.default_rng(seed)
    cases = []
    for number in range(falls):
        begin = float(rng.uniform(1.5, 2.3))
        spans = [(begin + 0.1 * step, begin + 0.1 * (step + 1), 0.15 + 0.1 * step) for step in range(8)]
        spans.append((begin + 0.8, 4.5, 0.99))
        cases.append(watched(4.5, spans, (Fall(begin, begin + 1.0),), f"fall-{number}"))
    for number in range(calm):
        at = float(rng.uniform(2.0, 3.0))
        cases.append(watched(4.5, [(at, at + 0.3, 0.6)], (), f"day-{number}"))
    return cases


def asked(method: str = "grid", jobs: int = 1, **changes: object) -> Question:
    words = ["probability_full=0.3:0.95:4", "probability_onset=0.1,0.25"] if method == "grid" else [
        "probability_full=0.3:0.98", "probability_onset=0.05:0.9"
    ]  # fmt: skip
    question = Question(60.0, method, parse_space(words, method), trials=20, folds=3, seed=1, jobs=jobs)
    return question._replace(**changes)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def answer() -> Answer:
    return recommend(days(), CONFIG, asked())


def test_it_finds_what_a_person_would(answer: Answer) -> None:
    """Above every calm day and below the falls: all falls are caught, nothing is needless."""
    best = answer.recommended
    assert (best.outcome.caught, best.outcome.falls, best.outcome.needless) == (6, 6, 0)
    assert answer.within
    softer = [judged for judged in answer.front if judged.outcome.lead_median_s > best.outcome.lead_median_s]
    assert softer, "longer leads cost needless interventions"
    assert all(judged.outcome.needless > 0 for judged in softer)


def test_the_counts_are_those_of_the_replay(answer: Answer) -> None:
    for case, tally in zip(answer.cases, answer.recommended.tallies, strict=True):
        assert tally == score_one(replay(case, answer.recommended.config, CONFIG.supervisor))


def test_what_does_not_matter_is_not_changed() -> None:
    """Nothing comes near the fall boundary here: thresholds of the distance stay as they are."""
    words = [
        "probability_full=0.3:0.98",
        "probability_onset=0.05:0.9",
        "distance_onset_sd=1:3",
        "approach_far_sd=2.5:5",
    ]
    question = asked("study", folds=2)._replace(space=parse_space(words, "study"))
    answer = recommend(days(falls=3, calm=3), CONFIG, question)
    assert (answer.recommended.outcome.caught, answer.recommended.outcome.needless) == (3, 0)
    assert set(answer.recommended.setting) <= {"probability_full", "probability_onset"}
    for fold in answer.folds:
        assert set(fold.setting) <= {"probability_full", "probability_onset"}


def test_every_recording_is_held_out_once(answer: Answer) -> None:
    held = answer.held_out
    assert held is not None
    assert (held.falls, len(answer.folds)) == (6, 3)
    assert held.hours == pytest.approx(answer.present.outcome.hours)
    assert sum(fold.held_out.falls for fold in answer.folds) == 6


def test_a_fold_is_chosen_without_looking_at_it() -> None:
    """A recording of its own kind, which only one part holds, cannot be foreseen by the choice made without it."""
    cases = days(calm=5)
    cases.append(watched(4.5, [(2.0, 2.5, 0.97)], (), "odd"))  # a day that looks like a fall
    answer = recommend(cases, CONFIG, asked(budget_per_hour=1e-3))
    odd = next(fold for fold in answer.folds if fold.held_out.needless)
    assert odd.chosen_on.needless == 0
    assert answer.recommended.outcome.needless <= answer.held_out.needless  # type: ignore[union-attr]


@pytest.mark.parametrize("method", ["grid", "study"])
def test_how_many_work_on_it_changes_nothing(method: str) -> None:
    cases = days(falls=2, calm=2)
    one, two = (recommend(cases, CONFIG, asked(method, jobs, folds=2)) for jobs in (1, 2))
    for name in ("recommended", "every", "folds", "resampled"):  # as text: NaN is not NaN
        assert str(getattr(one, name)) == str(getattr(two, name))


def test_a_study_finds_what_a_grid_finds() -> None:
    answer = recommend(days(falls=3, calm=3), CONFIG, asked("study", folds=2))
    best = answer.recommended.outcome
    assert (best.caught, best.needless) == (3, 0)
    assert 2 < answer.tried <= 21


def test_pieces_of_work_are_put_together_in_order() -> None:
    cases = [course for number in range(3) for course in days(number, 1, 1)]
    configs = [CONFIG.intervention.model_copy(update={"probability_full": value}) for value in (0.6, 0.8, 0.95)]
    with Evaluator(cases, CONFIG.supervisor, Stages()) as evaluator:
        rows = evaluator.tallies(configs)
    for config, row in zip(configs, rows, strict=True):
        assert row == tuple(score_one(replay(case, config, CONFIG.supervisor)) for case in cases)


def test_hours_that_cannot_show_the_budget_are_said(answer: Answer) -> None:
    few = recommend(days(), CONFIG, asked(budget_per_hour=0.1))
    assert not few.supported
    (line,) = [line for line in findings(few) if line.startswith("Budget")]
    assert "cannot show it" in line
    assert "30 h" in line
    many = recommend(days(), CONFIG, asked(budget_per_hour=3000.0))
    assert many.supported
    assert any("kept, with 95 % confidence" in line for line in findings(many))


def test_what_must_be_known_is_said() -> None:
    answer = recommend([replace(case, labelled=False) for case in days(falls=0, calm=2)], CONFIG, asked())
    said = " ".join(notes(answer))
    assert "do not react to the changed controller" in said
    assert "taken as without" in said
    assert "There is no fall in these recordings" in said


def test_present_values_that_are_best_are_kept() -> None:
    config = CONFIG.model_copy(
        update={
            "intervention": CONFIG.intervention.model_copy(update={"probability_onset": 0.1, "probability_full": 0.95})
        }
    )
    question = asked()._replace(space=parse_space(["probability_full=0.2,0.3"], "grid"))
    answer = recommend(days(), config, question)
    assert answer.recommended.setting == {}
    assert any("keep them" in line for line in findings(answer))
    assert next(mark for mark, _ in rows(answer)) == "present, recommended"


def test_nothing_to_tune_on() -> None:
    with pytest.raises(SurefootError, match="nothing to tune on"):
        recommend([watched(0.3, ())], CONFIG, asked())


def test_a_proposal_the_wrong_way_round_is_turned() -> None:
    values = ordered({"probability_onset": 0.9, "probability_full": 0.4, "credible_full": 0.3})
    assert values == {"probability_onset": 0.4, "probability_full": 0.9, "credible_full": 0.3}
    for low, high in ORDERED:
        assert getattr(CONFIG.intervention, low) < getattr(CONFIG.intervention, high)
        assert configured(CONFIG.intervention, {low: 0.3, high: 0.2}) is None


def test_the_usual_spaces_hold_together() -> None:
    grid = GRID.grid(CONFIG.intervention)
    assert grid[0] == {}
    assert 100 < len(grid) < 400
    assert len({str(setting) for setting in grid}) == len(grid)
    assert {each.key for each in GRID.ranges} <= {each.key for each in STUDY.ranges}


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("nope=1:2", "no key of .intervention."),
        ("probability_full", "expected KEY=LOW:HIGH"),
        ("probability_full=", "expected KEY=LOW:HIGH"),
        ("probability_full=0.9:0.6", "expected KEY=LOW:HIGH"),
        ("probability_full=0.6:0.9:1", "expected KEY=LOW:HIGH"),
        ("probability_full=0.6:2", "2: input should be less than or equal to 1"),
        ("probability_full=a,b", "expected KEY=LOW:HIGH"),
        ("rise_per_s=nan,1", "finite"),
    ],
)
def test_what_cannot_be_varied(word: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_space([word], "grid")


def test_a_grid_that_is_too_large() -> None:
    words = [f"{key}=0.1:0.9:30" for key in ("credible_full", "unconfirmed_most", "probability_full")]
    with pytest.raises(ConfigError, match="27000 settings, limit 20000"):
        parse_space(words, "grid").grid(CONFIG.intervention)
    with pytest.raises(ConfigError, match="given twice"):
        parse_space(["probability_full=0.6,0.7", "intervention.probability_full=0.8,0.9"], "grid")
    with pytest.raises(ConfigError, match="a study needs LOW:HIGH"):
        parse_space(["probability_full=0.6"], "study")
