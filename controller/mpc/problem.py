"""The problem of one step: numbers on the fixed structure, nothing that remembers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bridge.messages import Floats


class Problem(NamedTuple):
    """`min x' P x / 2 + q' x` subject to `l <= A x <= u`, P by its upper triangle, in the structure's order."""

    P: Floats
    q: Floats
    A: Floats
    l: Floats  # noqa: E741  (the field's own letters)
    u: Floats
    matrices_changed: bool  # whether P or A differ from the last problem of the same assembly

    def flaw(self) -> str:
        """Return the name of what is not a number or crossed, '' if all is well."""
        # Matrices that have not changed have been looked at before, and the solver is not given them again.
        matrices = (("P", self.P), ("A", self.A)) if self.matrices_changed else ()
        for name, values in (*matrices, ("q", self.q)):
            # A sum is finite only if every term is.
            if not math.isfinite(values.sum()):
                return f"{name} of the problem is not finite"
        if (self.l <= self.u).all():
            return ""
        if np.isnan(self.l).any() or np.isnan(self.u).any():
            return "a bound of the problem is not a number"
        return "a lower bound of the problem exceeds its upper bound"
