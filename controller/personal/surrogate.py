"""What a person seems to like, from which of two settings felt better: radial basis functions under preferences.

GLISp's surrogate (Bemporad and Piga 2021, "Global optimization based on active preference learning with radial basis
functions", Machine Learning 110, section 3.1): a discomfort

    f(u) = sum_k beta_k phi(|u - u_k|),    phi(r) = 1 / (1 + (epsilon r)^2)

that is lower by sigma where a setting was preferred and within sigma where two felt the same, as far as the answers
agree with each other. Two things differ from the paper. The norm is that of the functions, `beta' Phi beta`, in
the place of `beta' beta`, so that two settings that lie close together cannot hide a large f between them; and slacks
count squared. The fit then is a nonnegative least-squares problem in the multipliers alpha of the answers,

    min_{alpha >= 0}  1/2 alpha' (A Phi A' + I / c) alpha - b' alpha,    beta = A' alpha,    A f >= b - slack,

which an active-set method ends exactly in a finite number of steps: the same answers give the same function.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from bridge.messages import Floats

SIGMA = 1.0  # the scale of f, which nobody measures


class Felt(StrEnum):
    """Which of the settings `first` and `second` felt better."""

    FIRST = "first"
    SECOND = "second"
    SAME = "same"


class Answer(NamedTuple):
    """One comparison of two settings, by their indices among the settings tried."""

    first: int
    second: int
    felt: Felt


class Surrogate(NamedTuple):
    """A fitted discomfort f."""

    settings: Floats  # (N, d) in the unit cube
    weights: Floats  # (N,) beta
    epsilon: float

    def __call__(self, points: Floats) -> Floats:
        """Return f at `points` (P, d), as (P,)."""
        value: Floats = basis(points, self.settings, self.epsilon) @ self.weights
        return value


def basis(points: Floats, settings: Floats, epsilon: float) -> Floats:
    """Return phi (P, N), the inverse quadratic, of the distances between `points` (P, d) and `settings` (N, d)."""
    apart = np.sum((points[:, None, :] - settings[None, :, :]) ** 2, axis=-1)
    value: Floats = 1.0 / (1.0 + epsilon**2 * apart)
    return value


def fit(settings: Floats, answers: Sequence[Answer], epsilon: float, trust: float) -> Surrogate:
    """Return the smallest f that agrees with `answers`.

    Args:
        settings: (N, d) those tried, in the unit cube.
        answers: at least one.
        epsilon: width of the basis functions; larger is narrower.
        trust: c; the larger, the more must f bend before an answer counts as a mistake.
    """
    rows, margins = _wishes(len(settings), answers)
    phi = basis(settings, settings, epsilon)
    # A little on the diagonal stands for what is never quite zero: nobody feels exactly the same twice.
    inner = np.linalg.cholesky(rows @ phi @ rows.T + np.eye(len(rows)) / trust)
    multipliers, _ = nnls(inner.T, np.linalg.solve(inner, margins))
    return Surrogate(settings, rows.T @ multipliers, epsilon)


def agreement(surrogate: Surrogate, answers: Sequence[Answer]) -> int:
    """Return how many `answers` a surrogate would have foretold by its sign alone; 'same' is foretold within sigma."""
    f = surrogate(surrogate.settings)
    right = 0
    for first, second, felt in answers:
        lead = f[second] - f[first]  # positive: first is better
        if felt is Felt.SAME:
            right += abs(lead) <= SIGMA
        else:
            right += lead > 0 if felt is Felt.FIRST else lead < 0
    return int(right)


def _wishes(count: int, answers: Sequence[Answer]) -> tuple[Floats, Floats]:
    """Return A (m, N) and b (m,) with A f >= b for every answer."""
    rows: list[Floats] = []
    margins: list[float] = []
    for first, second, felt in answers:
        lead = np.zeros(count)  # f(second) - f(first): positive where first is better
        lead[second], lead[first] = 1.0, -1.0
        if felt is Felt.SAME:
            rows += [lead, -lead]
            margins += [-SIGMA, -SIGMA]
        else:
            rows.append(lead if felt is Felt.FIRST else -lead)
            margins.append(SIGMA)
    return np.array(rows), np.array(margins)
