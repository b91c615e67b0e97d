"""Finding settings worth knowing: every one of a grid, or those that an Optuna study proposes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from bridge.config.intervention import InterventionConfig
from bridge.errors import MissingExtraError
from controller.tuning.choose import as_good
from controller.tuning.evaluate import Evaluator
from controller.tuning.score import Outcome, Tally, total
from controller.tuning.space import Setting, Space, changed, configured, ordered, rounded

BATCH: Final = 10  # proposals of a study that are tried at a time: fixed, or the answer would depend on --jobs
TRIES: Final = 20  # proposals for one that holds together, before a study gives up

Told = Callable[[float], None]  # how much more is done, of 1


class Tried(NamedTuple):
    """Settings that were tried, and the counts of every case for each."""

    settings: list[Setting]
    configs: list[InterventionConfig]
    tallies: list[tuple[Tally, ...]]

    def outcomes(self, cases: Sequence[int]) -> list[Outcome]:
        """Return the counts of some cases for each setting."""
        return [total(row[i] for i in cases) for row in self.tallies]


def search_grid(
    space: Space, present: InterventionConfig, evaluator: Evaluator, told: Told = lambda _share: None
) -> Tried:
    """Return every setting of the grid, the present one first."""
    settings = space.grid(present)
    configs = [InterventionConfig.model_validate({**present.model_dump(), **setting}) for setting in settings]
    return Tried(settings, configs, evaluator.tallies(configs, told))


def search_study(
    space: Space,
    present: InterventionConfig,
    evaluator: Evaluator,
    chosen_on: Sequence[int],
    trials: int,
    seed: int,
    told: Told = lambda _share: None,
) -> Tried:
    """Return the settings that a study proposed, the present one first.

    A tree-structured Parzen estimator with two aims (S. Watanabe, arXiv 2304.11127): long leads, where a missed fall
    counts 0, and few needless interventions.

    Args:
        space: what it varies.
        present: the setting it begins with.
        evaluator: counts in every case.
        chosen_on: the cases that the study may look at; the others are counted and not shown to it.
        trials: how many settings.
        seed: of the proposals.
        told: is told of progress.

    Raises:
        MissingExtraError: Optuna is not installed.
    """
    try:
        import optuna  # noqa: PLC0415 (an extra)
    except ImportError as error:
        raise MissingExtraError("--method study", "optuna", "tune") from error
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)
    study = optuna.create_study(directions=["maximize", "minimize"], sampler=sampler)
    first = {each.key: getattr(present, each.key) for each in space.ranges}
    if all(each.low <= first[each.key] <= each.high for each in space.ranges):
        study.enqueue_trial(first)
    tried = Tried([{}], [present], evaluator.tallies([present]))
    seen, asked = {str(present)}, 0
    while asked < trials:
        batch = _propose(study, space, present, min(BATCH, trials - asked))
        if not batch:
            break
        asked += len(batch)
        rows = evaluator.tallies([config for _, _, config in batch])
        for (trial, setting, config), row in zip(batch, rows, strict=True):
            outcome = total(row[i] for i in chosen_on)
            lead_s = sum(outcome.leads_s) / outcome.falls if outcome.falls else 0.0
            study.tell(trial, [lead_s, outcome.needless / max(outcome.hours, 1e-9)])
            if str(config) not in seen:
                seen.add(str(config))
                tried.settings.append(setting)
                tried.configs.append(config)
                tried.tallies.append(row)
        told(len(batch) / trials)
    return tried


def simplify(
    tried: Tried, number: int, present: InterventionConfig, evaluator: Evaluator, chosen_on: Sequence[int]
) -> int:
    """Return the number of a setting as good as that of `number` with little changed; add it to `tried`.

    One changed value after the other goes back to the present one, where that makes nothing worse on the cases chosen
    on: what was changed and does not matter there may matter elsewhere.
    """
    setting, goal = dict(tried.settings[number]), total(tried.tallies[number][i] for i in chosen_on)
    for key in tuple(setting):
        less = {name: value for name, value in setting.items() if name != key}
        config = configured(present, less)
        if config is None:
            continue
        (row,) = evaluator.tallies([config])
        if not as_good(total(row[i] for i in chosen_on), goal):
            continue
        setting = less
        if less in tried.settings:
            number = tried.settings.index(less)
            continue
        tried.settings.append(less)
        tried.configs.append(config)
        tried.tallies.append(row)
        number = len(tried.settings) - 1
    return number


def _propose(
    study: Any, space: Space, present: InterventionConfig, count: int
) -> list[tuple[Any, Setting, InterventionConfig]]:
    """Return `count` proposals that hold together."""
    import optuna  # noqa: PLC0415 (an extra)

    batch: list[tuple[Any, Setting, InterventionConfig]] = []
    for _ in range(TRIES * count):
        if len(batch) == count:
            break
        trial = study.ask()
        proposed = {each.key: trial.suggest_float(each.key, each.low, each.high) for each in space.ranges}
        values = dict(rounded(ordered(proposed)))
        config = configured(present, values)
        if config is None:
            study.tell(trial, state=optuna.trial.TrialState.FAIL)
            continue
        batch.append((trial, changed(present, values), config))
    return batch
