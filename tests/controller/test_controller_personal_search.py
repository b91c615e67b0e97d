"""Learning from comparisons: what the surrogate holds, what is proposed, and how near it comes to what people like."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.personal import Person, drawn, off, people, searched
from bridge.config.surefoot import SurefootConfig
from controller.personal.acquisition import best_point, unknown
from controller.personal.proposals import space_of
from controller.personal.search import Plan, first_settings, liked, next_question
from controller.personal.space import Parameter, Space
from controller.personal.surrogate import SIGMA, Answer, Felt, agreement, fit

FORWARD = space_of(SurefootConfig(), ("forward",))
BOX = Space(tuple(Parameter(f"p{k}", 1.0, 9.0, 3.0) for k in range(2)), lambda values: np.ones(len(values), dtype=bool))


def points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((count, 2))


class TestSurrogate:
    def test_consistent_answers_are_all_held_with_their_distance(self) -> None:
        tried = points(8)
        order = np.argsort(np.sum((tried - 0.4) ** 2, axis=1))
        answers = [Answer(int(i), int(j), Felt.FIRST) for i, j in itertools.pairwise(order)]
        f = fit(tried, answers, epsilon=1.5, trust=1e4)(tried)
        assert np.all(np.diff(f[order]) >= 0.9 * SIGMA)
        assert agreement(fit(tried, answers, 1.5, 1e4), answers) == len(answers)

    def test_it_makes_no_difference_which_of_the_two_is_called_first(self) -> None:
        tried = points(5)
        answers = [Answer(i, j, Felt.FIRST) for i, j in ((0, 1), (2, 3), (2, 1), (1, 0))]
        other = {Felt.FIRST: Felt.SECOND, Felt.SECOND: Felt.FIRST, Felt.SAME: Felt.SAME}
        turned = [Answer(b, a, other[felt]) for a, b, felt in answers]
        there, back = fit(tried, answers, 1.5, 10.0), fit(tried, turned, 1.5, 10.0)
        np.testing.assert_allclose(there.weights, back.weights, atol=1e-9)

    @pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
    def test_what_felt_the_same_is_close(self, first: int, second: int) -> None:
        # f rises from 0 past 2 to 3, and 1 lies beside 3: it looks bad until it is said to feel like 0
        tried = np.array([[0.1, 0.5], [0.9, 0.5], [0.5, 0.5], [1.0, 0.5]])
        rising = [Answer(0, 2, Felt.FIRST), Answer(2, 3, Felt.FIRST)]
        apart = fit(tried, rising, 1.5, 1e4)(tried)
        tied = fit(tried, [*rising, Answer(first, second, Felt.SAME)], 1.5, 1e4)(tried)
        assert apart[1] - apart[0] > 1.5 * SIGMA
        assert abs(tied[1] - tied[0]) <= 1.01 * SIGMA

    def test_a_single_contradiction_is_outvoted(self) -> None:
        tried = np.array([[0.2, 0.5], [0.8, 0.5], [0.25, 0.5], [0.75, 0.5]])
        answers = [
            Answer(0, 1, Felt.FIRST),
            Answer(2, 3, Felt.FIRST),
            Answer(2, 1, Felt.FIRST),
            Answer(1, 0, Felt.FIRST),
        ]
        f = fit(tried, answers, 1.5, 10.0)(tried)
        assert max(f[0], f[2]) < min(f[1], f[3])
        assert agreement(fit(tried, answers, 1.5, 10.0), answers) == 3

    @settings(max_examples=30, deadline=None)
    @given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), st.sampled_from(list(Felt))), min_size=1))
    def test_any_answers_give_a_finite_surrogate(self, said: Sequence[tuple[int, int, Felt]]) -> None:
        answers = [Answer(a, b, felt) for a, b, felt in said if a != b]
        if answers:
            assert np.isfinite(fit(points(6), answers, 1.5, 10.0)(points(20, seed=1))).all()


class TestAcquisition:
    def test_nothing_is_unknown_where_somebody_was_and_most_far_away(self) -> None:
        tried = np.array([[0.1, 0.1], [0.3, 0.2]])
        z = unknown(np.array([[0.1, 0.1], [0.12, 0.1], [0.9, 0.9]]), tried)
        assert z[0] == pytest.approx(0.0)
        assert 0.0 < z[1] < z[2] < 1.0

    def test_without_curiosity_the_lowest_point_far_enough_is_taken(self) -> None:
        tried = np.array([[0.2, 0.5], [0.8, 0.5]])
        surrogate = fit(tried, [Answer(0, 1, Felt.FIRST)], 1.5, 10.0)
        offered = np.array([[0.21, 0.5], [0.3, 0.5], [0.7, 0.5]])
        assert best_point(surrogate, offered, delta=0.0, apart=0.05) == 1
        assert best_point(surrogate, offered, delta=0.0, apart=0.001) == 0

    def test_curiosity_leads_away(self) -> None:
        tried = np.array([[0.2, 0.5], [0.3, 0.5]])
        surrogate = fit(tried, [Answer(0, 1, Felt.FIRST)], 1.5, 10.0)
        offered = np.array([[0.19, 0.5], [0.9, 0.9]])
        assert best_point(surrogate, offered, delta=0.0, apart=0.0) == 0
        assert best_point(surrogate, offered, delta=20.0, apart=0.0) == 1

    def test_where_all_is_near_the_farthest_is_taken(self) -> None:
        surrogate = fit(np.array([[0.5, 0.5], [0.6, 0.5]]), [Answer(0, 1, Felt.FIRST)], 1.5, 10.0)
        assert best_point(surrogate, np.array([[0.5, 0.5], [0.4, 0.5]]), delta=0.0, apart=5.0) == 1


class TestQuestions:
    @pytest.mark.parametrize("axes", [("forward",), ("forward", "left"), ("forward", "left", "yaw")])
    def test_every_proposal_is_safe_inside_the_bounds_and_new(self, axes: tuple[str, ...]) -> None:
        space = space_of(SurefootConfig(), axes)
        tried, answers = first_settings(space), list[Answer]()
        rng = np.random.default_rng(3)
        for _ in range(10):
            asked = next_question(space, Plan(10, seed=4), tried, answers)
            tried = asked.settings
            assert {asked.a, asked.b} >= {len(tried) - 1}
            assert asked.a != asked.b
            answers.append(Answer(asked.a, asked.b, rng.choice(list(Felt))))
        assert space.safe(tried).all()
        for values, side in zip(tried.T, space.parameters, strict=True):
            assert ((values >= side.low) & (values <= side.high)).all()
        assert len(np.unique(tried, axis=0)) == len(tried)

    def test_the_first_comparison_is_with_the_setting_in_use(self) -> None:
        asked = next_question(FORWARD, Plan(12), first_settings(FORWARD), [])
        assert 0 in {asked.a, asked.b}
        np.testing.assert_allclose(asked.settings[0], FORWARD.present)

    def test_the_new_setting_hides_behind_either_name(self) -> None:
        names = {next_question(BOX, Plan(12, seed), first_settings(BOX), []).a for seed in range(12)}
        assert names == {0, 1}

    def test_the_same_answers_give_the_same_question(self) -> None:
        tried, answers = first_settings(BOX), [Answer(0, 1, Felt.SECOND), Answer(1, 2, Felt.SAME)]
        tried = np.vstack([tried, [[2.0, 5.0], [6.0, 2.0]]])
        first, again = (next_question(BOX, Plan(12, 5), tried, answers) for _ in range(2))
        np.testing.assert_array_equal(first.settings, again.settings)
        assert first[1:] == again[1:]
        other = next_question(BOX, Plan(12, 6), tried, answers)
        assert not np.array_equal(first.settings, other.settings)

    def test_nothing_answered_means_that_what_is_in_use_is_liked(self) -> None:
        assert liked(BOX, np.vstack([first_settings(BOX), [[5.0, 5.0]]]), []) == 0

    def test_what_is_only_proposed_is_not_yet_liked(self) -> None:
        tried = np.vstack([first_settings(BOX), [[5.0, 5.0], [6.0, 6.0]]])
        assert liked(BOX, tried, [Answer(1, 0, Felt.FIRST)]) == 1


class TestPeople:
    """On simulated people with known optima; the table in docs/personalise.md is `python -m benchmarks.personal`."""

    @pytest.mark.parametrize(
        ("axes", "comparisons", "character", "near"),
        [
            (("forward",), 12, "sure", 0.15),
            (("forward",), 12, "attentive", 0.16),
            (("forward",), 12, "wavering", 0.22),
            (("forward", "left"), 18, "attentive", 0.18),
        ],
    )
    def test_it_comes_nearer_than_chance(
        self, axes: tuple[str, ...], comparisons: int, character: str, near: float
    ) -> None:
        space = space_of(SurefootConfig(), axes)
        asked = list(people(space, character, count=16, seed=1))
        found = [off(searched(space, person, comparisons, k), person) for k, person in enumerate(asked)]
        guessed = [off(drawn(space, person, comparisons, k), person) for k, person in enumerate(asked)]
        started = [off(space.present, person) for person in asked]
        assert np.median(found) < near
        assert np.mean(found) < 0.8 * np.mean(guessed)
        assert np.mean(found) < 0.5 * np.mean(started)

    def test_more_comparisons_come_nearer(self) -> None:
        asked = list(people(FORWARD, "attentive", count=8, seed=2))
        few, many = (
            np.mean([off(searched(FORWARD, person, count, k), person) for k, person in enumerate(asked)])
            for count in (4, 14)
        )
        assert many < 0.6 * few

    def test_who_feels_no_difference_keeps_what_is_in_use_or_what_is_new(self) -> None:
        numb = replace(next(people(FORWARD, "sure", count=1)), same=100.0)
        assert FORWARD.safe(searched(FORWARD, numb, 6, seed=0)[None]).all()

    def test_an_optimum_at_the_edge_of_what_is_safe_is_approached(self) -> None:
        edge = Person(np.array([120.0, 60.0]), np.ones(2), 0.0, 0.0)  # coasts for exactly the longest time allowed
        assert off(searched(FORWARD, edge, 14, seed=1), edge) < 0.2
