"""Whether the networks are there, whole, and the ones of this release."""

from __future__ import annotations

import hashlib
import importlib
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from bridge.doctor.finding import Finding, Level, Patient
from bridge.errors import CheckpointError

WEIGHTS: Final = "weights"
SUMS: Final = "SHA256SUMS"  # beside the weights of a release, as sha256sum writes it


def check_weights(patient: Patient) -> Iterator[Finding]:
    """Whether the checkpoint loads, and whether the one that came with Surefoot is still the same."""
    # by its name: the bridge imports no other package
    checkpoint: Any = importlib.import_module("anticipation.checkpoint")
    shipped: Any = importlib.import_module("anticipation.shipped")
    path = Path(shipped.weights(patient.config.anticipation.checkpoint))
    yield judge_weights(path, checkpoint.load, shipped=path.parent == shipped.FOLDER)


def judge_weights(path: Path, load: Any, *, shipped: bool) -> Finding:
    """Return the finding for the checkpoint in `path`.

    Args:
        path: of the checkpoint.
        load: reads it, or raises CheckpointError.
        shipped: whether it came with Surefoot, with its sum beside it.
    """
    again = f"git checkout -- {shlex.quote(str(path.parent))}, or install Surefoot again"
    mend = again if shipped else "surefoot train, or leave anticipation.checkpoint empty"
    try:
        load(path)
    except CheckpointError as error:
        return Finding(WEIGHTS, Level.BROKEN, str(error), mend)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    wanted = _sum(path) if shipped else ""
    if wanted and found != wanted:
        text = f"{path}: is not what came with this release: sha256 {found[:12]}, expected {wanted[:12]}"
        return Finding(WEIGHTS, Level.BROKEN, text, mend)
    return Finding(WEIGHTS, Level.GOOD, f"{path}: loads, sha256 {found[:12]}{', as released' if wanted else ''}")


def _sum(path: Path) -> str:
    """Return the sum that is written beside `path`, '' if there is none."""
    sums = path.with_name(SUMS)
    if not sums.is_file():
        return ""
    lines = (line.split() for line in sums.read_text(encoding="utf-8").splitlines())
    return next((words[0] for words in lines if words[1:] == [path.name]), "")
