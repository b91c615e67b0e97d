"""Moving labels apart that would overlap."""

from __future__ import annotations

from collections.abc import Sequence


def spread(places: Sequence[float], gap: float) -> list[float]:
    """Return ascending `places` in [0, 1] moved as little as it takes for them to be `gap` apart.

    Neighbours that are too near move apart around their mean.
    """
    groups: list[list[float]] = []
    for place in places:
        groups.append([place])
        while len(groups) > 1 and _centre(groups[-1]) - _centre(groups[-2]) < 0.5 * gap * (
            len(groups[-1]) + len(groups[-2])
        ):
            last = groups.pop()
            groups[-1].extend(last)
    moved: list[float] = []
    for group in groups:
        first = _centre(group) - 0.5 * gap * (len(group) - 1)
        moved.extend(first + gap * index for index in range(len(group)))
    return moved


def _centre(group: Sequence[float]) -> float:
    return sum(group) / len(group)
