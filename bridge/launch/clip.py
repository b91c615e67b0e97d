"""The recording that ships: a generated walk, stumble and fall."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Final

from bridge.errors import SourceError

CLIP: Final = "walk-stumble-fall"


def shipped_recording() -> Path:
    """Return the keypoint file that holds `CLIP`.

    Raises:
        SourceError: the installation lacks it.
    """
    file = Path(str(resources.files("simulation"))) / "demo" / f"{CLIP}.npz"
    if not file.is_file():
        raise SourceError(f"{file}: the recording that comes with Surefoot is missing from this installation")
    return file
