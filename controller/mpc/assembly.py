"""Fills the problem of each step in place: two compiled calls, one only when damping, stiffness or height moved."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from bridge.messages import Floats
from controller.admittance import AdmittanceStages
from controller.mpc.compiled import Kernel, compiled
from controller.mpc.problem import Problem
from controller.mpc.structure import POINT, Structure

# Tip-over rows hang on the column's height by the carriage's share of the centre of mass: 5 mm move it by 1 mm.
RELINEARISE_M = 0.005


class Instant(NamedTuple):
    """Everything one step of the MPC rests on."""

    law: AdmittanceStages
    wrench: Floats  # (6,) of the person now [N, N m]
    draw: Floats  # (4,) force that draws the command to the measured motion
    velocity: Floats  # (4,) commanded
    previous: Floats  # (4,) acceleration applied until now
    height_m: float  # commanded


class Assembly:
    """Fills problems on one structure; keeps the arrays and what they were last filled from.

    Attributes:
        tip_rows: (4, 4) what accelerations add to the four tipping edges, at the last instant.
        tip_high: (4,) how much of that the instant allows; the first stage's limits, not opened.
    """

    def __init__(self, structure: Structure, compile_c: bool = True) -> None:
        matrices, vectors = _functions(structure, compile_c)
        damping, stiffness, load = (np.zeros(4 * structure.setting.stages) for _ in range(3))
        self._point: Floats = np.zeros(vectors.nnz_in(0))
        self._damping, self._stiffness, self._load = damping, stiffness, load
        self._linearised: Floats = np.array([np.nan])
        self._matrices = Kernel(matrices, [damping, stiffness, self._linearised])
        self._vectors = Kernel(vectors, [self._point, damping, stiffness, load])
        tipping = self._vectors.outputs[3]
        self.tip_rows, self.tip_high = tipping[:16].reshape(4, 4), tipping[16:]
        self._rendered: tuple[bytes, bytes] = (b"", b"")

    def flaw(self) -> str:
        """Return what of the last instant is not a number, '' if all is: a maximum in a bound would pass over it."""
        if math.isfinite(self._point.sum()):
            return ""
        names = (
            name for name, where in zip(POINT._fields, POINT, strict=True) if not np.isfinite(self._point[where]).all()
        )
        return f"{next(names)} of the instant is not finite"

    def fill(self, instant: Instant) -> Problem:
        """Return the problem of this instant; its arrays are the assembly's own and change with the next call."""
        law = instant.law
        point = self._point
        point[POINT.height] = instant.height_m
        point[POINT.velocity] = instant.velocity
        point[POINT.previous] = instant.previous
        point[POINT.wrench] = instant.wrench
        point[POINT.draw] = instant.draw
        changed = False
        if not abs(instant.height_m - float(self._linearised[0])) <= RELINEARISE_M:
            self._linearised[0] = instant.height_m
            changed = True
        point[POINT.linearised] = self._linearised
        rendered = (law.damping.tobytes(), law.stiffness.tobytes())
        if rendered != self._rendered:
            self._rendered = rendered
            self._damping[:] = law.damping.ravel()
            self._stiffness[:] = law.stiffness.ravel()
            changed = True
        self._load[:] = law.load.ravel()
        if changed:
            self._matrices()
        self._vectors()
        P, A = self._matrices.outputs
        q, lower, upper = self._vectors.outputs[:3]
        return Problem(P, q, A, lower, upper, changed)


@lru_cache(maxsize=8)
def _functions(structure: Structure, compile_c: bool) -> tuple[Any, Any]:
    matrices, vectors = compiled([structure.matrices, structure.vectors], compile_c)
    return matrices, vectors
