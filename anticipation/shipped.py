"""The weights that come with the package, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent / "weights"
DEFAULT: Final = FOLDER / "default.safetensors"
NAMED: Final = {"": DEFAULT, "default": DEFAULT, "simulated": FOLDER / "simulated.safetensors"}


def weights(name: str) -> Path:
    """Return the file that `anticipation.checkpoint` means: shipped weights by their name, or a path."""
    return NAMED.get(name, Path(name))
