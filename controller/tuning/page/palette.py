"""The colours of the page by day and by night; they mean what they mean in every other picture (bridge.colours)."""

from __future__ import annotations

from typing import Final, NamedTuple

from bridge.colours import FALL, STABLE, STATE_COLOUR, TRANSIENT


class Palette(NamedTuple):
    """One look of the page."""

    paper: str
    card: str
    ink: str
    quiet: str
    grid: str
    stable: str
    transient: str
    fall: str
    ahead: str
    stiffening: str
    states: dict[str, str]


DAY: Final = Palette(
    paper="#f4f5f7",
    card="#ffffff",
    ink="#222222",
    quiet="#6b6b6b",
    grid="#e6e6e6",
    stable=STABLE,
    transient="#c96a00",  # the pictures' orange, darker: small text in it must be readable
    fall=FALL,
    ahead="#00757b",
    stiffening="#6b4ba0",
    states=STATE_COLOUR,
)
NIGHT: Final = Palette(
    paper="#14171c",
    card="#1d2128",
    ink="#e8e8e8",
    quiet="#a3a8b0",
    grid="#333943",
    stable="#6ea8e0",
    transient=TRANSIENT,
    fall="#f0716a",
    ahead="#35c3c9",
    stiffening="#b39be0",
    states={
        "DISARMED": "#2b2f36",
        "FOLLOW": "#24405c",
        "GUARD": "#6b4a12",
        "ARREST": "#7d2f29",
        "RECOVER": "#27502f",
        "SAFE_STOP": "#4b4f57",
    },
)
