"""Many settings over many cases, in parallel; what comes out does not depend on how many work on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import joblib

from bridge.config.intervention import InterventionConfig
from bridge.config.supervisor import SupervisorConfig
from controller.tuning.cases import Case
from controller.tuning.course import Stages, inputs
from controller.tuning.replay import replay
from controller.tuning.score import Intervening, Tally, score_one

TURNS: Final = 2_000_000  # of one piece of work: several a second for whom waits, few enough to be worth the way

Told = Callable[[float], None]  # how much more is done, of 1


class Evaluator:
    """Counts what settings do in cases; `with` keeps the workers for its block."""

    def __init__(
        self,
        cases: Sequence[Case],
        supervisor: SupervisorConfig,
        stages: Stages,
        by: Intervening = Intervening.ARREST,
        jobs: int = 1,
    ) -> None:
        """Take the cases that settings are tried on; their counts come back in this order."""
        self.cases = tuple(cases)
        self._supervisor, self._stages, self._by, self._jobs = supervisor, stages, by, jobs
        self._parallel = joblib.Parallel(n_jobs=jobs, return_as="generator", batch_size=1)

    def __enter__(self) -> Evaluator:
        self._parallel.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._parallel.__exit__(*error)

    def tallies(
        self, configs: Sequence[InterventionConfig], told: Told = lambda _share: None
    ) -> list[tuple[Tally, ...]]:
        """Return for each setting the counts of every case."""
        pieces = list(self._pieces(len(configs)))
        work = (
            joblib.delayed(_count)([self.cases[i] for i in some], configs[begin:end], self._supervisor,
                                   self._stages, self._by)
            for some, begin, end in pieces
        )  # fmt: skip
        columns: list[list[Tally]] = [[] for _ in configs]
        weight = sum(case.ticks for case in self.cases) * max(len(configs), 1)
        for (some, begin, _), counted in zip(pieces, self._parallel(work), strict=True):
            for offset, tallies in enumerate(counted):
                columns[begin + offset].extend(tallies)
            told(sum(self.cases[i].ticks for i in some) * len(counted) / weight)
        return [tuple(column) for column in columns]

    def _pieces(self, settings: int) -> list[tuple[list[int], int, int]]:
        """Return which cases and which settings (begin, end) make a piece, cases in order for each setting."""
        bundles: list[list[int]] = []
        turns = 0
        target = max(min(TURNS // max(settings, 1), sum(case.ticks for case in self.cases) // self._jobs), 1)
        for index, case in enumerate(self.cases):
            if not bundles or turns >= target:
                bundles.append([])
                turns = 0
            bundles[-1].append(index)
            turns += case.ticks
        pieces: list[tuple[list[int], int, int]] = []
        for bundle in bundles:
            size = max(TURNS // max(sum(self.cases[i].ticks for i in bundle), 1), 1)
            pieces += [(bundle, begin, min(begin + size, settings)) for begin in range(0, settings, size)]
        return pieces


def _count(
    cases: Sequence[Case],
    configs: Sequence[InterventionConfig],
    supervisor: SupervisorConfig,
    stages: Stages,
    by: Intervening,
) -> list[list[Tally]]:
    rows: list[list[Tally]] = [[] for _ in configs]
    for case in cases:
        known = inputs(case, supervisor)
        for row, config in zip(rows, configs, strict=True):
            row.append(score_one(replay(case, config, supervisor, stages, known), by))
    return rows
