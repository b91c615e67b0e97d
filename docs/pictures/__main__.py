"""Draws the pictures of docs/concepts.md by the code that they explain.

    python docs/pictures --out docs/images        # or: make pictures

The fall in them is the recording that ships, run through the live nodes in simulated time.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Final

from horizon import draw_horizon
from matplotlib.figure import Figure
from plane import draw_plane
from profile_stages import draw_profile
from skeleton import draw_skeleton
from states import draw_states
from trial import perform
from wire import draw_wire


def main() -> None:
    """Draw all, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(PICTURES)}; default: all")
    parser.add_argument("--out", type=Path, default=Path("docs/images"), help="folder [default: docs/images]")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(PICTURES)
    if unknown:
        parser.error(f"no picture {', '.join(sorted(unknown))}; there are {', '.join(PICTURES)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or PICTURES:
        file = arguments.out / f"concept-{name}.png"
        part = file.with_name(f"{file.name}.part")
        PICTURES[name]().savefig(part, format="png", dpi=110, facecolor="white")
        part.replace(file)
        print(file)


PICTURES: Final[dict[str, Callable[[], Figure]]] = {
    "skeleton": draw_skeleton,
    "horizon": lambda: draw_horizon(perform()),
    "plane": lambda: draw_plane(perform()),
    "profile": lambda: draw_profile(perform()),
    "states": draw_states,
    "wire": draw_wire,
}

if __name__ == "__main__":
    main()
