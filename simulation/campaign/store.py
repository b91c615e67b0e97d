"""A campaign's folder: what was planned, one file for each scenario that is done, and nothing half-written."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from bridge.errors import SurefootError

PLAN: Final = "campaign.json"
TRIALS: Final = "trials"
FORMAT: Final = 1  # of the files of a folder


class Store:
    """The folder of one campaign; opened again it goes on where it was.

    Raises:
        SurefootError: the folder holds another campaign.
    """

    def __init__(self, folder: Path, plan: Mapping[str, Any]) -> None:
        self.folder = folder
        self._trials = folder / TRIALS
        file, wanted = folder / PLAN, {"format": FORMAT, **_plain(plan)}
        if file.exists():
            there = _read(file)
            for key, value in wanted.items():
                if there.get(key) != value:
                    has, wants = _short(there.get(key)), _short(value)
                    raise SurefootError(
                        f"{folder} holds a campaign with {key} = {has}, wanted {wants}; name another folder with --out"
                    )
        self._trials.mkdir(parents=True, exist_ok=True)
        write(file, wanted)

    def done(self, name: str) -> bool:
        """Whether the scenario `name` is there."""
        return self._file(name).exists()

    def keep(self, name: str, result: Mapping[str, Any]) -> None:
        """Store the result of a scenario, whole or not at all."""
        write(self._file(name), result)

    def result(self, name: str) -> dict[str, Any]:
        """Return a stored result; numbers that were none are NaN again."""
        stored: dict[str, Any] = json.loads(self._file(name).read_text(encoding="utf-8"))
        for trial in stored["trials"].values():
            trial["measures"] = {key: math.nan if v is None else v for key, v in trial["measures"].items()}
        return stored

    def _file(self, name: str) -> Path:
        return self._trials / f"{name}.json"


def _read(file: Path) -> dict[str, Any]:
    """Return what a campaign's folder says of itself.

    Raises:
        SurefootError: it cannot be read, or another version of Surefoot wrote it.
    """
    try:
        there = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SurefootError(f"{file}: cannot be read ({error}); name another folder with --out") from error
    found = there.get("format", 1) if isinstance(there, dict) else None  # before there were formats it was this one
    if found != FORMAT:
        raise SurefootError(
            f"{file.parent} holds a campaign of format {found}, this Surefoot reads and writes {FORMAT}:"
            " name another folder with --out"
        )
    return {**there, "format": FORMAT}


def write(file: Path, value: Any) -> None:
    """Write `value` as JSON, beside the file and then in its place; NaN and infinity become null."""
    partial = file.with_name(f".{file.name}.partial")
    partial.write_text(json.dumps(_plain(value), indent=1, sort_keys=True) + "\n", encoding="utf-8")
    partial.replace(file)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 40 else text[:37] + "..."
