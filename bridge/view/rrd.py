"""A `.rrd` file that is there whole, or not at all."""

from __future__ import annotations

import importlib
import os
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Self

from bridge.errors import SurefootError

SUFFIX: Final = ".rrd"


class RrdFile:
    """Takes the name only when `finish` has found the file whole; until then it is a hidden neighbour.

    Raises:
        SurefootError: the name is taken or has another ending, or its folder cannot be written.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        if path.suffix != SUFFIX:
            raise SurefootError(f"{path}: Rerun reads files that end in {SUFFIX}")
        if not overwrite and (path.exists() or path.is_symlink()):
            raise SurefootError(f"{path}: the name is taken; --force replaces it")
        try:
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=SUFFIX)
        except OSError as error:
            raise SurefootError(f"{path}: cannot be written: {error.strerror}") from error
        os.close(handle)
        self.path, self.part = path, Path(name)

    def finish(self) -> None:
        """Check what was written, and give it its name.

        Raises:
            SurefootError: it is not whole, as on a full disk; nothing is kept.
        """
        reader: Any = importlib.import_module("rerun.chunk").RrdReader
        try:
            with warnings.catch_warnings(action="ignore"):  # what it warns of is what is asked here
                reader(self.part).store()  # reads the footer, which is written last
        except Exception as error:
            raise SurefootError(f"{self.path}: could not be written whole; is the disk full?") from error
        try:
            mask = os.umask(0)
            os.umask(mask)
            self.part.chmod(0o666 & ~mask)  # mkstemp's 0o600 would keep it from others
            self.part.replace(self.path)
        except OSError as error:
            raise SurefootError(f"{self.path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        with suppress(OSError):
            self.part.unlink()
