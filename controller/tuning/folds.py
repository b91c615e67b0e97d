"""Splitting recordings so that a setting is judged on some that had no say in its choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.tuning.cases import Case


def folds(cases: Sequence[Case], count: int, seed: int) -> list[int]:
    """Return for each case the fold it belongs to, 0 .. `count` - 1, or fewer where there are fewer groups.

    What was recorded together (`Case.group`) stays together. Recordings with falls and those without are dealt out one
    after the other, longest first among equals of a drawn order, so that every fold has its share of both.
    """
    groups = sorted({case.group for case in cases})
    order = np.random.default_rng(seed).permutation(len(groups))
    falls = {group: sum(len(case.falls) for case in cases if case.group == group) for group in groups}
    length_s = {group: sum(case.duration_s for case in cases if case.group == group) for group in groups}
    shuffled = [groups[i] for i in order.tolist()]
    count = min(count, len(groups))
    with_falls = sorted((g for g in shuffled if falls[g]), key=lambda g: -falls[g])
    without = sorted((g for g in shuffled if not falls[g]), key=lambda g: -round(length_s[g], 1))
    fold_of: dict[str, int] = {}
    load = [0.0] * count
    for position, group in enumerate(with_falls):
        fold_of[group] = position % count
    for group in without:  # to the fold with the least time of daily life so far
        fold = min(range(count), key=load.__getitem__)
        fold_of[group] = fold
        load[fold] += length_s[group]
    return [fold_of[case.group] for case in cases]
