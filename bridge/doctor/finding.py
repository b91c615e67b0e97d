"""What a check has to say, and what every check is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from bridge.config.surefoot import SurefootConfig


class Level(StrEnum):
    """How bad it is."""

    GOOD = "good"
    NOTE = "note"  # nothing is wrong, but it is worth knowing
    WARNING = "warning"  # it runs, not as well as it could
    BROKEN = "broken"  # something of what the configuration asks for does not work


class Finding(NamedTuple):
    """One line of the report."""

    check: str
    level: Level
    text: str
    mend: str = ""  # the command, or what else to do


@dataclass(frozen=True)
class Patient:
    """What is examined: this machine, for one configuration."""

    config_path: Path | None  # as given; None: the built-in values
    overrides: tuple[str, ...]
    config: SurefootConfig  # the built-in values, where the file cannot be read


Check = Callable[[Patient], Iterable[Finding]]
