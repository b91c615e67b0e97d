"""Choosing for a budget, judging on what had no say, and how sure it all is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from controller_tuning_streams import run_of, watched

from bridge.errors import ConfigError
from bridge.messages import GaitState
from controller.tuning.cases import Fall
from controller.tuning.choose import choose, pareto, parse_budget
from controller.tuning.confidence import bootstrap, hours_needed, poisson, rate_bound, wilson
from controller.tuning.folds import folds
from controller.tuning.score import Outcome, score_one


def outcome(caught: int, lead_s: float, needless: int, hours: float = 20.0, falls: int = 10) -> Outcome:
    return Outcome(falls, caught, 0, (lead_s,) * caught, needless, hours)


@pytest.mark.parametrize(
    ("text", "per_hour"),
    [("1 in 10 h", 0.1), ("2 in 5 hours", 0.4), ("1/h", 1.0), ("1 per hour", 1.0), ("0.25", 0.25), (" 1 in 10h ", 0.1)],
)
def test_budgets(text: str, per_hour: float) -> None:
    assert parse_budget(text) == pytest.approx(per_hour)


@pytest.mark.parametrize("text", ["", "none", "1 in 0 h", "0", "-1", "nan", "1 in 10 min"])
def test_budgets_that_are_none(text: str) -> None:
    with pytest.raises(ConfigError, match="--budget"):
        parse_budget(text)


def test_the_budget_comes_first_then_falls_then_lead_then_what_is_near() -> None:
    tried = [outcome(10, 0.5, 9), outcome(9, 0.3, 2), outcome(9, 0.5, 2), outcome(9, 0.5, 2), outcome(8, 0.9, 0)]
    chosen = choose(tried, 0.1, [0.0, 0.1, 0.5, 0.2, 0.0])
    assert (chosen.number, chosen.within) == (3, True)
    assert choose(tried, 1.0, [0.0] * 5).number == 0
    assert choose(tried, 0.05, [0.0] * 5).number == 4


def test_without_any_setting_in_the_budget_the_fewest_needless_is_chosen_and_it_is_said() -> None:
    chosen = choose([outcome(10, 0.5, 9), outcome(7, 0.2, 5), outcome(9, 0.2, 5)], 0.1, [0.0, 1.0, 2.0])
    assert (chosen.number, chosen.within) == (2, False)


def test_leads_that_differ_by_less_than_a_frame_are_the_same() -> None:
    assert choose([outcome(9, 0.400, 0), outcome(9, 0.405, 0)], 0.1, [0.0, 1.0]).number == 0


def test_the_front_holds_what_nothing_beats() -> None:
    rng = np.random.default_rng(4)
    tried = [
        outcome(int(rng.integers(0, 11)), float(rng.integers(1, 20)) / 30, int(rng.integers(0, 12))) for _ in range(60)
    ]
    front = pareto(tried, [0.0] * 60)

    def beats(a: Outcome, b: Outcome) -> bool:
        ours = (a.caught, round(30 * np.nan_to_num(a.lead_median_s)), -a.needless)
        theirs = (b.caught, round(30 * np.nan_to_num(b.lead_median_s)), -b.needless)
        return ours != theirs and all(x >= y for x, y in zip(ours, theirs, strict=True))

    assert all(not beats(other, tried[i]) for i in front for other in tried)
    for i, one in enumerate(tried):
        assert any(i == j or beats(tried[j], one) or tried[j] == one for j in front)
    assert [tried[i].needless for i in front] == sorted(tried[i].needless for i in front)


def test_intervals() -> None:
    assert wilson(36, 39) == pytest.approx((0.923, 0.797, 0.973), abs=1e-3)
    assert poisson(0, 10.0) == pytest.approx((0.0, 0.0, 0.369), abs=1e-3)  # tables of Garwood
    assert poisson(5, 1.0) == pytest.approx((5.0, 1.623, 11.668), abs=1e-3)
    assert rate_bound(0, 30.0) == pytest.approx(3.0 / 30.0, rel=2e-3)  # the rule of three
    assert hours_needed(0, 0.1) == pytest.approx(30.0, rel=2e-3)
    assert math.isnan(wilson(0, 0).value)
    assert math.isinf(rate_bound(0, 0.0))


def test_the_bound_holds_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    counts = rng.poisson(0.3 * 10.0, 4000)
    assert np.mean([rate_bound(int(n), 10.0) >= 0.3 for n in counts]) >= 0.945


def test_resampling_takes_whole_recordings() -> None:
    fall = (Fall(4.0, 5.0, 7.0),)
    runs = [run_of([(5.0 - lead_s, GaitState.ARREST)], 8.0, fall) for lead_s in (0.2, 0.3, 0.4, 0.5)]
    tallies = [score_one(run)._replace(group=f"g{i}") for i, run in enumerate(runs)]
    resampled = bootstrap(tallies, 0)
    assert resampled.lead_median_s.value == pytest.approx(0.35)
    assert 0.2 <= resampled.lead_median_s.low < 0.35 < resampled.lead_median_s.high <= 0.5
    assert bootstrap(tallies, 0) == resampled
    together = bootstrap([tally._replace(group="one") for tally in tallies], 0)
    assert together.lead_median_s.low == pytest.approx(0.35)  # one recording alone has nothing to draw from


def test_what_was_recorded_together_is_held_out_together_and_every_part_has_falls() -> None:
    fall = (Fall(1.0, 1.5, 2.0),)
    cases = [watched(3.0, (), fall if i < 10 else (), f"c{i}") for i in range(40)]
    cases += [watched(3.0, (), fall, f"c{i}") for i in range(10)]  # the same falls, another camera
    fold_of = folds(cases, 5, seed=0)
    assert set(fold_of) == set(range(5))
    assert fold_of[40:] == fold_of[:10]
    for fold in range(5):
        assert sum(fold_of[i] == fold for i in range(10)) == 2
        assert sum(fold_of[i] == fold for i in range(10, 40)) == 6
    assert folds(cases, 5, seed=0) == fold_of
    assert folds(cases, 5, seed=1) != fold_of
    assert folds(cases[:1], 5, seed=0) == [0]
