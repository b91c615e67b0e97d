"""How clips are divided: by group for honest numbers, by window for comparison with the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


def grouped_folds(groups: Sequence[str], folds: int, seed: int) -> list[tuple[Indices, Indices]]:
    """Divide clips into folds so that no group is on both sides.

    Returns (training, test) indices for each fold; every clip is tested once.

    Raises:
        ValueError: there are fewer groups than folds.
    """
    names = sorted(set(groups))
    if len(names) < folds:
        raise ValueError(f"{len(names)} groups cannot be divided into {folds} folds")
    order = np.random.default_rng(seed).permutation(len(names))
    fold_of = {names[group]: position % folds for position, group in enumerate(order)}
    assigned = np.array([fold_of[group] for group in groups])
    return [(np.flatnonzero(assigned != fold), np.flatnonzero(assigned == fold)) for fold in range(folds)]


def random_windows(windows: int, seed: int, training: float = 0.8) -> tuple[Indices, Indices]:
    """Divide windows at random, as the paper's 80/20 split may be read.

    Neighbouring windows share 14 of their 15 frames, so the test windows are all but
    seen in training: the numbers say how well a network remembers, not how well it foresees.
    """
    order = np.random.default_rng(seed).permutation(windows)
    cut = round(training * windows)
    return np.sort(order[:cut]), np.sort(order[cut:])
