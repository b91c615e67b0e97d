"""How the body moves through the image: what coordinates relative to its centre do not say.

A person who goes down without leaning hardly changes in relative coordinates. The velocity of the upper-body centre is
carried beside them as one more row of a frame.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from bridge.messages import STEP_S, Floats

SPAN_S: Final = 0.2
"""The row says how far the centre goes in this time [body lengths]: about as large a number as a coordinate."""
FASTEST: Final = 8.0 * SPAN_S
"""Bound on either component [body lengths]: nobody falls at 8 body lengths a second, but a tracker may jump."""


def centre_velocity(centre_px: Floats, before_px: Floats, body_length_px: float | Floats, ticks: int = 1) -> Floats:
    """Return the velocity between two places of the centre, (..., 2) [body lengths in 0.2 s]; 0 where one is not known.

    Args:
        centre_px: (..., 2) now, NaN where unknown [px].
        before_px: (..., 2) `ticks` ticks earlier [px].
        body_length_px: scalar or (...), as from `BodyScale` [px].
        ticks: ticks of 1/30 s between the two.
    """
    length = np.asarray(body_length_px, dtype=np.float64)[..., None]
    velocity = (centre_px - before_px) / length * (SPAN_S / (ticks * STEP_S))
    known = np.isfinite(velocity).all(axis=-1, keepdims=True)
    bounded: Floats = np.where(known, np.clip(velocity, -FASTEST, FASTEST), 0.0)
    return bounded


def path(velocity: Floats, body_length_px: float) -> Floats:
    """Return how far the centre has gone after each tick at velocities (T, 2), (T, 2) [px]."""
    gone: Floats = np.cumsum(velocity, axis=0) * (body_length_px * STEP_S / SPAN_S)
    return gone
