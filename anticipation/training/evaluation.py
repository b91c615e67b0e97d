"""Fit on some recordings, test on others, and compare with what needs less."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import Progress
from torch import nn

from anticipation.mirror import mirrored
from anticipation.motion import WINDOW, Forecast, constant_velocity, zero_velocity
from anticipation.training.clips import FALL, UNLABELLED
from anticipation.training.corpus import DAILY_STRIDE, Corpus, Shares, Tested, people_folds, shares, tested
from anticipation.training.fitting import apply
from anticipation.training.measures import STEPS, ForecastError, Score, forecast_error, score
from anticipation.training.networks import fitted_classifier, fitted_shifted, pretrained_forecaster, tuned_forecaster
from anticipation.training.plan import Plan
from anticipation.training.samples import Samples, Track, cut
from anticipation.training.splits import random_windows

ALARM: Final = 0.5  # probability of a fall at 500 ms that would count as an alarm
NAIVE: Final[dict[str, Forecast]] = {"zero velocity": zero_velocity, "constant velocity": constant_velocity}


@dataclass(slots=True)
class Outcome:
    """What the test parts of all folds gave; one entry a fold."""

    shipped: str  # name of the row made as the shipped checkpoint is
    scores: dict[str, list[Score]] = field(default_factory=dict)
    errors: dict[str, list[ForecastError]] = field(default_factory=dict)
    alarms: dict[str, list[tuple[int, int]]] = field(default_factory=dict)  # kind of motion: alarms, windows
    logits: list[NDArray[np.float32]] = field(default_factory=list)  # (M, 16, 3) of the shipped row
    labels: list[NDArray[np.int64]] = field(default_factory=list)  # (M, 16)
    tested: int = 0  # labelled frames in whole windows
    excluded: int = 0  # labelled frames without a whole window


@dataclass(frozen=True, slots=True)
class Models:
    """The networks of one fold."""

    forecaster: nn.Module
    classifier: nn.Module  # fitted on forecast windows: the one that is shipped
    plain: nn.Module  # fitted on windows seen
    shifted: nn.Module


def grouped(corpus: Corpus, plan: Plan, folds: int, seed: int, keypoints: Tested, progress: Progress) -> Outcome:
    """Test on recordings whose group no network has seen."""
    outcome = Outcome(_shipped(plan))
    pretrained = pretrained_forecaster(plan, shares(corpus, ()), progress)
    for number, (training, test) in enumerate(people_folds(corpus, folds, seed), start=1):
        known = shares(corpus, [corpus.people[index] for index in training])
        models = _fit(pretrained, plan, known, f"fold {number}/{folds}", progress)
        tracks = tested(corpus, test, keypoints)
        _test(outcome, plan, models, cut(tracks))
        _count(outcome, tracks)
        _alarms(outcome, models, corpus, {corpus.people[index].name for index in test})
    return outcome


def paper(corpus: Corpus, plan: Plan, seed: int, keypoints: Tested, progress: Progress) -> Outcome:
    """Test on a random fifth of the windows of the same recordings, as the paper may have done.

    Overlapping windows lie on both sides. Only for comparison with numbers obtained that way.
    """
    outcome = Outcome(_shipped(plan))
    everything = shares(corpus, corpus.people)
    tracks = tested(corpus, np.arange(len(corpus.people)), keypoints)
    windows = cut(tracks)
    training, test = random_windows(len(windows), seed)
    others = shares(corpus, [track for track in corpus.people if track not in corpus.falls])
    half = (windows.take(training), 0.6)
    split = Shares([half, *others.motion], [half, *others.gait], everything.walks)
    models = _fit(pretrained_forecaster(plan, split, progress), plan, split, "random windows", progress)
    _test(outcome, plan, models, windows.take(test))
    _count(outcome, tracks)
    return outcome


def predict(classifier: nn.Module, forecast: Forecast, samples: Samples) -> NDArray[np.float32]:
    """Return logits (M, 16, 3) of the present and the 15 foreseen steps.

    As in `Predictor`, they are the mean of the motion's and its mirror image's.
    """
    seen = samples.poses[:, :WINDOW]

    def run(window: torch.Tensor) -> torch.Tensor:
        sides = (window, mirrored(window))
        one, other = (classifier(torch.cat((side, forecast(side)), dim=1)) for side in sides)
        logits: torch.Tensor = 0.5 * (one + other)
        return logits

    return apply(run, seen)


def _shipped(plan: Plan) -> str:
    return f"{plan.forecaster} + DGNN on forecasts"


def _fit(pretrained: nn.Module, plan: Plan, known: Shares, name: str, progress: Progress) -> Models:
    forecaster = tuned_forecaster(pretrained, plan, known, name, progress)
    return Models(
        forecaster,
        fitted_classifier(plan, known, forecaster, name, progress),
        fitted_classifier(plan, known, None, name, progress),
        fitted_shifted(plan, known, name, progress),
    )


def _test(outcome: Outcome, plan: Plan, models: Models, samples: Samples) -> None:
    """Score one fold's networks and what they are compared with."""

    def note(row: str, predicted: NDArray[np.int64]) -> None:
        outcome.scores.setdefault(row, []).append(score(predicted, samples))

    logits = predict(models.classifier, models.forecaster, samples)
    outcome.logits.append(logits)
    outcome.labels.append(samples.labels)
    note(outcome.shipped, logits.argmax(axis=-1))
    note(f"{plan.forecaster} + plain DGNN", predict(models.plain, models.forecaster, samples).argmax(axis=-1))
    for name, forecast in NAIVE.items():
        note(f"{name} + plain DGNN", predict(models.plain, forecast, samples).argmax(axis=-1))
    shifted = apply(models.shifted, samples.poses[:, :WINDOW]).argmax(axis=-1)  # (M, 6)
    predicted = np.zeros(samples.labels.shape, dtype=np.int64)
    predicted[:, list(STEPS)] = shifted
    note("DGNN only, shifted", predicted)
    labelled = samples.labels[samples.labels >= 0]
    note("majority class", np.full(samples.labels.shape, np.bincount(labelled).argmax()))

    forecasts: dict[str, Forecast] = {plan.forecaster: models.forecaster, **NAIVE}
    for name, forecast in forecasts.items():
        futures = apply(forecast, samples.poses[:, :WINDOW])
        outcome.errors.setdefault(name, []).append(forecast_error(futures, samples))


def _count(outcome: Outcome, tracks: list[Track]) -> None:
    labelled = sum(int((track.labels != UNLABELLED).sum()) for track in tracks)
    whole = sum(int((cut([track]).labels[:, 0] != UNLABELLED).sum()) for track in tracks)
    outcome.tested += whole
    outcome.excluded += labelled - whole


_LYING: Final = "lying on purpose (see docs)"
_KINDS: Final = {
    "activity06": "UP-Fall walking",
    "activity07": "UP-Fall standing",
    "activity08": "UP-Fall sitting",
    "activity09": "UP-Fall picking up",
    "activity10": "UP-Fall jumping",
    "activity11": "UP-Fall before lying down",
}


def _alarms(outcome: Outcome, models: Models, corpus: Corpus, held_out: set[str]) -> None:
    """Count windows without a fall, from recordings not learnt from, in which the networks foresee one in 500 ms.

    Frames of daily life that carry no label show somebody lying on purpose: these are counted by themselves.
    """
    counts: dict[str, list[int]] = {}
    daily = [(_KINDS.get(track.name[:10], "URFD adl-40"), [track]) for track in corpus.daily if track.name in held_out]
    for kind, tracks in [*daily, ("mocap, mostly gait", list(corpus.kept_walks))]:
        samples = cut(tracks, DAILY_STRIDE)
        if not len(samples):
            continue
        logits = predict(models.classifier, models.forecaster, samples)[:, -1].astype(np.float64)
        weights = np.exp(logits - logits.max(axis=-1, keepdims=True))
        alarm = weights[:, FALL] / weights.sum(axis=-1) > ALARM
        soon = samples.known[:, -1] & (samples.labels[:, -1] == UNLABELLED)
        lying = (samples.labels[:, 0] == UNLABELLED) | soon
        for name, there in ((kind, ~lying), (_LYING, lying)):
            count = counts.setdefault(name, [0, 0])
            count[0] += int((alarm & there).sum())
            count[1] += int(there.sum())
    for name, (alarms, windows) in counts.items():
        if windows:
            outcome.alarms.setdefault(name, []).append((alarms, windows))
