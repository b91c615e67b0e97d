"""Rerun, loaded when it is needed and missed by name."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import Any, NamedTuple

from bridge.errors import MissingExtraError


class Rerun(NamedTuple):
    """The three parts of the package that are used."""

    sdk: Any  # `rerun`
    blueprint: Any  # `rerun.blueprint`
    viewer: Path  # the program, without the wrapper that keeps signals from it


def load_rerun() -> Rerun:
    """Import Rerun, silent: what goes wrong with a viewer or a file is found out and said here.

    Raises:
        MissingExtraError: it is not installed.
    """
    said = os.environ.get("RUST_LOG")  # read once, at the import
    os.environ["RUST_LOG"] = said or "off"
    try:
        program = importlib.import_module("rerun_cli").__file__
        return Rerun(
            importlib.import_module("rerun"),
            importlib.import_module("rerun.blueprint"),
            Path(str(program)).parent / "rerun",
        )
    except ImportError as error:
        raise MissingExtraError("surefoot view", "rerun-sdk", "view") from error
    finally:
        if said is None:
            del os.environ["RUST_LOG"]
