"""From the answers so far to the next two settings, and to the setting that is liked best.

A pure function of space, plan, settings and answers: whoever knows the answers can go on, at any time and anywhere.
The constants were chosen on simulated people, most of whom err now and then (`python -m benchmarks.personal`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from bridge.messages import Floats
from controller.personal.acquisition import best_point
from controller.personal.space import Space
from controller.personal.surrogate import Answer, Surrogate, fit

COMPARISONS_PER_PARAMETER: Final = 6
_CANDIDATES: Final = 2048
_EPSILON: Final = 1.5  # width of the basis functions: a setting speaks for two thirds of the cube's side around it
_TRUST: Final = 10.0
_DELTA: Final = 1.5  # weight of what is not known, at the beginning; none is left at the end
_APART: Final = (0.15, 0.06)  # of the cube's side along each parameter: from what was tried, at first and at last
_MARGIN: Final = 0.25  # the first settings keep this much of the cube's side away from its walls


@dataclass(frozen=True)
class Plan:
    """How a person is asked."""

    comparisons: int  # how many in all
    seed: int = 0  # of the candidates, and of which setting is called a


class Question(NamedTuple):
    """Which feels better: two of the settings tried, by their indices; the newest of them is the last."""

    settings: Floats  # (N, d) values
    a: int
    b: int


def first_settings(space: Space) -> Floats:
    """Return what a study begins with: the setting in use, (1, d)."""
    return space.present[None, :]


def next_question(space: Space, plan: Plan, settings: Floats, answers: Sequence[Answer]) -> Question:
    """Return what to ask after `answers` about `settings` (N, d): a new setting against the one liked best so far.

    The first ones, one more than there are parameters, are spread over the inner part of the box. The later ones are
    where GLISp's acquisition is least; its weight of what is not known falls to zero towards the last comparison.
    Which of the two is called a is drawn, so that nobody can tell the new one by its name.
    """
    rng = np.random.default_rng((plan.seed, len(answers)))
    best = liked(space, settings, answers)
    if len(answers) <= len(space.parameters):
        new = _spread(space, settings, rng)
    else:
        new = _promising(space, settings, answers, 1.0 - len(answers) / plan.comparisons, rng)
    newest = len(settings)
    a, b = (newest, best) if rng.random() < 0.5 else (best, newest)
    return Question(np.vstack([settings, new]), a, b)


def liked(space: Space, settings: Floats, answers: Sequence[Answer]) -> int:
    """Return which of `settings` (N, d) is liked best: that of least discomfort; of equals, the newest compared.

    Not simply the winner of the last comparison: a single wrong answer then would throw away what all others say.
    """
    if not answers:
        return 0
    f = surrogate_of(space, settings, answers)(space.unit(settings))
    compared = sorted({index for answer in answers for index in answer[:2]})
    return min(compared, key=lambda index: (round(float(f[index]), 9), -index))


def surrogate_of(space: Space, settings: Floats, answers: Sequence[Answer]) -> Surrogate:
    """Return the discomfort that the answers speak of, over the unit cube."""
    return fit(space.unit(settings), answers, _EPSILON, _TRUST)


def _spread(space: Space, settings: Floats, rng: np.random.Generator) -> Floats:
    """Return the setting farthest from all those tried, away from the walls where that can be had."""
    values = space.draw(_CANDIDATES, rng)
    points = space.unit(values)
    inner = np.all((points > _MARGIN) & (points < 1.0 - _MARGIN), axis=1)
    if inner.any():
        values, points = values[inner], points[inner]
    apart = np.sum((points[:, None, :] - space.unit(settings)[None, :, :]) ** 2, axis=-1)
    farthest: Floats = values[int(np.argmax(apart.min(axis=1)))]
    return farthest


def _promising(
    space: Space, settings: Floats, answers: Sequence[Answer], left: float, rng: np.random.Generator
) -> Floats:
    """Return the setting to try next while the share `left` of the comparisons is to come."""
    values = space.draw(_CANDIDATES, rng, settings[liked(space, settings, answers)])
    first, last = _APART
    apart = (last + (first - last) * left) * len(space.parameters) ** 0.5
    chosen = best_point(surrogate_of(space, settings, answers), space.unit(values), _DELTA * left, apart)
    promising: Floats = values[chosen]
    return promising
