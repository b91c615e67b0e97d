"""The problem of one step: numbers on the fixed structure, nothing that remembers."""

from __future__ import annotations

from typing import NamedTuple

from bridge.messages import Floats


class Problem(NamedTuple):
    """`min x' P x / 2 + q' x` subject to `l <= A x <= u`, P by its upper triangle, in the structure's order."""

    P: Floats
    q: Floats
    A: Floats
    l: Floats  # noqa: E741  (the field's own letters)
    u: Floats
    matrices_changed: bool  # whether P or A differ from the last problem of the same assembly
