"""The colours in which pictures and views show the same things, after the paper's figures."""

from __future__ import annotations

from typing import Final

STABLE, TRANSIENT, FALL = "#2f6fb3", "#ee8a1d", "#c8322b"
CLASS_COLOURS: Final = (STABLE, TRANSIENT, FALL)  # in the order of the classes
FORECAST: Final = "#00b4c8"
INK, FAINT = "#222222", "#9a9a9a"
STATE_COLOUR: Final = {
    "DISARMED": "#ececec",
    "FOLLOW": "#d6e6f5",
    "GUARD": "#fbd9a3",
    "ARREST": "#f2a79f",
    "RECOVER": "#cfe8cf",
    "SAFE_STOP": "#c4c4c4",
}


def rgb(colour: str) -> tuple[int, int, int]:
    """Return `#rrggbb` as red, green and blue, 0..255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def tint(colour: str, share: float) -> tuple[int, int, int]:
    """Return `colour` mixed with white: 1 is the colour itself, 0 is white."""
    red, green, blue = (round(255 - share * (255 - part)) for part in rgb(colour))
    return red, green, blue
