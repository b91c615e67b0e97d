"""The journal of a training run: how far each of its fits has come, so that a killed run continues.

A run is a list of fits, each with a name. After every epoch the state of the fit that is in work is written to
`NAME.safetensors`, whole or not at all: weights, averaged weights, the optimizer's moments and the random generators
as tensors; epoch, losses, rates and a fingerprint of what the fit started from as JSON in the header. No pickle. A fit
that is found at its last epoch is finished; one that is found in the middle goes on from there, with the very numbers
an uninterrupted run would have had.
"""

from __future__ import annotations

import fcntl
import json
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from safetensors import SafetensorError
from safetensors.torch import load as from_bytes
from safetensors.torch import save as to_bytes
from torch import Tensor

from anticipation.checkpoint import write_whole
from anticipation.training.team import Team
from bridge.errors import SurefootError

FORMAT: Final = 1
_HEADER: Final = "surefoot-run"
_SETTINGS: Final = "run.json"
_LOCK: Final = "lock"


class Saved(NamedTuple):
    """The state of a fit after some epochs."""

    tensors: dict[str, Tensor]
    facts: dict[str, Any]  # what JSON can say, at least 'epoch' and 'fingerprint'


class Journal:
    """The folder of one run. Only the leading process of a team touches it; the others are told what it holds."""

    def __init__(self, folder: Path, settings: Mapping[str, Any], team: Team, fresh: bool = False) -> None:
        """Open the folder, or make it.

        Args:
            folder: where the run is kept.
            settings: what the run's result depends on, for a person to read.
            team: the processes of the run.
            fresh: forget what is there.

        Raises:
            SurefootError: it holds another run, or cannot be written.
        """
        self.folder = folder
        self.begun = False  # whether an earlier process left something to go on from
        self._team = team
        self._names: set[str] = set()
        self._lock: BinaryIO | None = None
        if team.leads:
            try:
                self._open(dict(settings), fresh)
            except BaseException:
                self.close()
                raise

    def begin(self, name: str) -> None:
        """Note that a fit of this name begins.

        Raises:
            ValueError: there was one.
        """
        if not name or name in self._names:
            raise ValueError(f"a fit of a run needs a name of its own, got '{name}'")
        self._names.add(name)

    def read(self, name: str, fingerprint: str) -> Saved | None:
        """Return where the fit was stopped; None if it had not begun.

        Raises:
            SurefootError: the file is damaged, or of a fit that began otherwise.
        """
        path = self._path(name)
        content = path.read_bytes() if self._team.leads and path.is_file() else None
        content = self._team.from_leader(content)
        if content is None:
            return None
        saved = _parse(path, content)
        if saved.facts.get("fingerprint") != fingerprint:
            raise SurefootError(
                f"{path}: '{name}' began with other data, settings or versions; "
                "name another folder with --run-folder, or forget this one with --fresh"
            )
        return saved

    def write(self, name: str, saved: Saved) -> None:
        """Keep the state of a fit in place of the one before."""
        if self._team.leads:
            header = {_HEADER: json.dumps({"format": FORMAT, "fit": name, **saved.facts})}
            tensors = {key: value.detach().cpu().contiguous() for key, value in saved.tensors.items()}
            write_whole(self._path(name), to_bytes(tensors, metadata=header))

    def finish(self) -> None:
        """Remove the states of the fits: the run's result is written elsewhere."""
        if self._team.leads:
            self._clear()

    def close(self) -> None:
        """Let others into the folder."""
        if self._lock is not None:
            self._lock.close()

    def _open(self, settings: dict[str, Any], fresh: bool) -> None:
        path = self.folder / _SETTINGS
        settings = json.loads(json.dumps(settings))  # as they will be read back
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._hold()
            if fresh:
                self._clear()
            self.begun = any(self.folder.glob("*.safetensors"))
            if path.is_file():
                self._compare(path, settings)
            else:
                write_whole(path, (json.dumps(settings, indent=1) + "\n").encode())
        except OSError as error:
            raise SurefootError(f"cannot keep the run in '{self.folder}': {error.strerror}") from error

    def _hold(self) -> None:
        """Keep others out of the folder; the system lets go when the process ends, however it ends."""
        self._lock = (self.folder / _LOCK).open("wb")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SurefootError(
                f"another process trains in '{self.folder}': name another folder with --run-folder"
            ) from error

    def _compare(self, path: Path, settings: dict[str, Any]) -> None:
        try:
            kept = json.loads(path.read_text())
        except ValueError as error:
            raise SurefootError(f"{path}: not JSON ({error}); start anew with --fresh") from error
        for name in [*settings, *(kept if isinstance(kept, dict) else ())]:
            before, now = kept.get(name) if isinstance(kept, dict) else None, settings.get(name)
            if before != now:
                raise SurefootError(
                    f"the run in '{self.folder}' was begun with {name} {before}, now it is {now}: "
                    "give the same, name another folder with --run-folder, or forget that run with --fresh"
                )

    def _clear(self) -> None:
        unfinished = self.folder.glob(".*.safetensors.*")  # what a killed process was writing
        for path in [self.folder / _SETTINGS, *self.folder.glob("*.safetensors"), *unfinished]:
            with suppress(FileNotFoundError):
                path.unlink()

    def _path(self, name: str) -> Path:
        return self.folder / f"{re.sub('[^A-Za-z0-9_.]+', '-', name)}.safetensors"


def _parse(path: Path, content: bytes) -> Saved:
    """Read what `write` wrote.

    Raises:
        SurefootError: it is something else.
    """
    try:
        tensors = from_bytes(content)
        length = int.from_bytes(content[:8], "little")
        facts = json.loads(json.loads(content[8 : 8 + length])["__metadata__"][_HEADER])
        if facts["format"] != FORMAT:
            raise ValueError(f"format is {facts['format']}, this version reads {FORMAT}")
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise SurefootError(f"{path}: not the state of a fit ({error}); start anew with --fresh") from error
    return Saved(tensors, facts)
