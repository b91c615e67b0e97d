"""Which thresholds are varied, and how far.

The ranges are those that docs/tuning.md calls sensible; for the probability they reach further, because without
settings that are too sensitive and too dull there is no trade-off to see.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Final, NamedTuple

from pydantic import ValidationError

from bridge.config.intervention import InterventionConfig
from bridge.errors import ConfigError

Setting = dict[str, float | int]  # values of `[intervention]` that differ from the file's

MOST_GRID: Final = 20_000
DIGITS: Final = 3  # a threshold is not known better


class Range(NamedTuple):
    """One threshold: its reach, and the values that a grid takes."""

    key: str
    low: float
    high: float
    values: tuple[float, ...]


class Space(NamedTuple):
    """The thresholds that are varied."""

    ranges: tuple[Range, ...]

    def grid(self, present: InterventionConfig) -> list[Setting]:
        """Return every combination that holds together, the present values first.

        Raises:
            ConfigError: there are too many.
        """
        size = math.prod(len(each.values) for each in self.ranges)
        if size > MOST_GRID:
            raise ConfigError(f"a grid of {size} settings, limit {MOST_GRID}; vary less, or use --method study")
        keys = [each.key for each in self.ranges]
        settings: list[Setting] = [{}]
        for values in product(*(each.values for each in self.ranges)):
            setting = changed(present, dict(zip(keys, values, strict=True)))
            if setting and configured(present, setting) is not None:
                settings.append(setting)
        return settings

    def change(self, setting: Setting, present: InterventionConfig) -> float:
        """Return how far a setting lies from the present one, each threshold in shares of its range."""
        spans = {each.key: each.high - each.low for each in self.ranges}
        moved = {key: abs(value - float(getattr(present, key))) for key, value in setting.items()}
        return sum(moved[key] / spans[key] for key in moved if spans.get(key, 0.0) > 0.0)


def _even(key: str, low: float, high: float, count: int) -> Range:
    values = [low + (high - low) * index / (count - 1) for index in range(count)] if count > 1 else [low]
    return Range(key, low, high, tuple(dict.fromkeys(_rounded(key, value) for value in values)))


def _listed(key: str, *values: float) -> Range:
    return Range(key, min(values), max(values), tuple(dict.fromkeys(_rounded(key, value) for value in values)))


def _rounded(key: str, value: float) -> float | int:
    whole = InterventionConfig.model_fields[key].annotation is int
    return round(value) if whole else round(value, DIGITS)


GRID: Final = Space((
    _listed("probability_onset", 0.2, 0.35, 0.6, 0.8, 0.9),
    _listed("probability_full", 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999),
    _listed("unconfirmed_most", 0.7, 0.9),
    _listed("distance_onset_sd", 0.5, 1.5, 2.5),
))  # fmt: skip

STUDY: Final = Space((
    _even("distance_onset_sd", 0.5, 3.0, 6),
    _even("distance_full_sd", -2.0, 0.5, 6),
    _even("approach_onset_s", 0.4, 1.2, 5),
    _even("approach_full_s", 0.05, 0.5, 4),
    _even("approach_far_sd", 2.0, 5.0, 4),
    _even("approach_near_sd", 0.5, 4.0, 4),
    _even("credible_onset", 0.1, 0.5, 5),
    _even("credible_full", 0.4, 0.9, 6),
    _even("unconfirmed_most", 0.5, 1.0, 6),
    _even("probability_onset", 0.2, 0.95, 6),
    _even("probability_full", 0.4, 1.0, 7),
))  # fmt: skip


def parse_space(words: Sequence[str], method: str) -> Space:
    """Return what is to be varied.

    Args:
        words: such as `probability_full=0.6:0.95:8` (low, high, how many in a grid) or `probability_full=0.6,0.8`;
            none: the usual thresholds.
        method: 'grid' or 'study'.

    Raises:
        ConfigError: a word that is none of these, an unknown key, or a value out of the key's limits.
    """
    if not words:
        return GRID if method == "grid" else STUDY
    ranges = [_parse(word) for word in words]
    keys = [each.key for each in ranges]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise ConfigError(f"--vary {twice[0]}: given twice")
    if method == "study" and (one := [each.key for each in ranges if each.low == each.high]):
        raise ConfigError(f"--vary {one[0]}: a single value; a study needs LOW:HIGH")
    return Space(tuple(ranges))


def configured(present: InterventionConfig, setting: Mapping[str, float | int]) -> InterventionConfig | None:
    """Return `present` with other values; None when they do not hold together."""
    try:
        return InterventionConfig.model_validate({**present.model_dump(), **setting})
    except ValidationError:
        return None


def changed(present: InterventionConfig, values: Mapping[str, float | int]) -> Setting:
    """Return those of `values` that differ from the present ones."""
    return {key: value for key, value in values.items() if value != getattr(present, key)}


ORDERED: Final = (  # a proposal that has them the wrong way round means the other way round
    ("distance_full_sd", "distance_onset_sd"),
    ("approach_full_s", "approach_onset_s"),
    ("approach_near_sd", "approach_far_sd"),
    ("credible_onset", "credible_full"),
    ("probability_onset", "probability_full"),
    ("release_per_s", "rise_per_s"),
    ("rise_per_s", "arrest_per_s"),
)


def ordered(values: Mapping[str, float]) -> dict[str, float]:
    """Return `values` with each pair of thresholds that has an order in that order."""
    put = dict(values)
    for low, high in ORDERED:
        if low in put and high in put and put[low] > put[high]:
            put[low], put[high] = put[high], put[low]
    return put


def rounded(values: Mapping[str, float]) -> Iterator[tuple[str, float | int]]:
    """Give keys and values with as many digits as a threshold deserves."""
    for key, value in values.items():
        yield key, _rounded(key, value)


def _parse(word: str) -> Range:
    key, equals, text = word.partition("=")
    key = key.strip().removeprefix("intervention.")
    if key not in InterventionConfig.model_fields:
        raise ConfigError(
            f"--vary {word}: no key of [intervention]; known: {', '.join(InterventionConfig.model_fields)}"
        )
    parts = text.split(":")
    try:
        if not equals or not text:
            raise ValueError
        if len(parts) == 1:
            made = _listed(key, *(float(part) for part in text.split(",")))
        elif len(parts) in (2, 3):
            count = int(parts[2]) if len(parts) == 3 else 5
            made = _even(key, float(parts[0]), float(parts[1]), count)
            if not 2 <= count <= 1000 or made.low >= made.high:
                raise ValueError
        else:
            raise ValueError
    except ValueError:
        raise ConfigError(f"--vary {word}: expected KEY=LOW:HIGH, KEY=LOW:HIGH:COUNT or KEY=A,B,C") from None
    for value in (made.low, made.high):
        _within(word, key, value)
    return made


def _within(word: str, key: str, value: float) -> None:
    """Raise unless a value is within the limits of its key; what other keys allow is another matter."""
    try:
        InterventionConfig.__pydantic_validator__.validate_assignment(
            InterventionConfig.model_construct(**InterventionConfig().model_dump()), key, value
        )
    except ValidationError as error:
        first = error.errors()[0]
        if first["loc"]:
            raise ConfigError(f"--vary {word}: {value:g}: {first['msg'][0].lower()}{first['msg'][1:]}") from None
