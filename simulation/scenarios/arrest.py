"""What counts as an arrested fall, for a single trial and for a campaign."""

from __future__ import annotations

from math import radians
from typing import Final

ALLOWED_DROP_M: Final = 0.10  # of the pelvis from standing height: Vector Elite's default is 0.101 m
TIPPED_RAD: Final = radians(10.0)  # the walker's frame from the upright
