"""The problem of one step: numbers on the fixed structure, nothing that remembers."""

from __future__ import annotations

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
        for name in ("P", "q", "A"):
            if not np.isfinite(getattr(self, name)).all():
                return f"{name} of the problem is not finite"
        if np.isnan(self.l).any() or np.isnan(self.u).any():
            return "a bound of the problem is not a number"
        if (self.l > self.u).any():
            return "a lower bound of the problem exceeds its upper bound"
        return ""
