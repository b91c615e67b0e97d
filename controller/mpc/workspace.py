"""The numbers of one problem and its answer in place, with the operations on them: in C, or else in CasADi's machine.

Both ways fill the same arrays with the same numbers (tested). Nothing is allocated after construction.
"""

from __future__ import annotations

import ctypes
import logging
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from bridge.messages import Floats
from controller.mpc import checks
from controller.mpc.compiled import Kernel, library
from controller.mpc.condensing import Condensed
from controller.mpc.problem import Problem
from controller.mpc.structure import Structure

_log = logging.getLogger(__name__)

_INTEGERS = ("stages", "limited", "n", "m", "cost_count", "constraint_count", "condensed_rows")
_LAYOUT = ("limited_stages", "cost_columns", "cost_rows", "constraint_columns", "constraint_rows")
_PROBLEM = ("P", "q", "A", "lower", "upper", "x", "y", "flaws", "residuals")
_SOURCES = ("cost_sources", "constraint_sources", "order", "own_first")
_CONDENSED = ("dynamics", "U", "M", "f", "low", "high", "z", "multipliers")


class _Pointers(ctypes.Structure):
    """`Workspace` of loops.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in _INTEGERS),
        *((name, ctypes.c_void_p) for name in (*_LAYOUT, *_PROBLEM, *_SOURCES, *_CONDENSED, "room")),
    )


class Workspace:
    """A problem (`P, q, A, lower, upper`), its answer (`x, y`) and what is counted of both.

    With a condensed form also `U` = R^-1 by axis (4N, N), `M` (rows, 4N), `f`, `low`, `high`, and the answer `z`,
    `multipliers` to it.

    Attributes:
        compiled: whether the operations run as machine code.
    """

    def __init__(self, structure: Structure, condensed: Condensed | None = None, compile_c: bool = True) -> None:
        cost, constraints, stages = structure.cost, structure.constraints, structure.setting.stages
        n, m = cost.shape[0], constraints.shape[0]
        self._structure, self._condensed = structure, condensed
        self.P, self.q = np.zeros(len(cost.indices)), np.zeros(n)
        self.A = np.zeros(len(constraints.indices))
        self.lower, self.upper = np.zeros(m), np.zeros(m)
        self.x, self.y = np.zeros(n), np.zeros(m)
        self.flaws: Floats = np.zeros(4)
        self.residuals: Floats = np.zeros(4)
        rows, inputs = condensed.size if condensed is not None else (0, 0)
        self.U: Floats = np.zeros((inputs, stages))
        self.M: Floats = np.zeros((rows, inputs))
        self.f, self.z = np.zeros(inputs), np.zeros(inputs)
        self.low, self.high, self.multipliers = np.zeros(rows), np.zeros(rows), np.zeros(rows)
        self._room: Floats = np.zeros(n + m + stages * (stages + 4))
        path = library(resources.files("controller.mpc").joinpath("loops.c").read_text("utf-8")) if compile_c else None
        code = _loaded(path)
        self.compiled = code is not None
        if code is not None:
            self._bind(code)
        else:
            self._interpret()

    def take(self, problem: Problem, with_matrices: bool) -> None:
        """Copy a problem's numbers in."""
        np.copyto(self.q, problem.q)
        np.copyto(self.lower, problem.l)
        np.copyto(self.upper, problem.u)
        if with_matrices:
            np.copyto(self.P, problem.P)
            np.copyto(self.A, problem.A)

    def count_flaws(self) -> None:
        """Fill `flaws` (see `checks.flaws`)."""
        self._count_flaws()

    def count_residuals(self) -> None:
        """Fill `residuals` from `x` and `y` (see `checks.residuals`)."""
        self._count_residuals()

    def condense(self) -> None:
        """Fill `U` and `M` from `P` and `A`."""
        self._condense()

    def reduce(self) -> None:
        """Fill `f`, `low` and `high` from the problem and `U`; overwrites `x`."""
        self._reduce()

    def expand(self) -> None:
        """Fill `x` and `y` from `z` and `multipliers`."""
        self._expand()

    def _bind(self, code: ctypes.CDLL) -> None:
        structure, condensed = self._structure, self._condensed
        layout: dict[str, Any] = {
            "limited_stages": structure.setting.sparse_stages,
            "cost_columns": structure.cost.indptr,
            "cost_rows": structure.cost.indices,
            "constraint_columns": structure.constraints.indptr,
            "constraint_rows": structure.constraints.indices,
        }
        if condensed is not None:
            layout |= {
                "cost_sources": condensed.cost_sources,
                "constraint_sources": condensed.constraint_sources,
                "order": condensed.order,
                "own_first": [*(rows.start for rows in condensed.own_rows), condensed.shared_rows.start],
            }
        # C reads these arrays for as long as the workspace lives.
        self._layout = {name: np.ascontiguousarray(values, dtype=np.intc) for name, values in layout.items()}
        self._dynamics: Floats = condensed.dynamics if condensed is not None else np.zeros(0)
        pointers = _Pointers(
            stages=structure.setting.stages,
            limited=len(structure.setting.sparse_stages),
            n=structure.cost.shape[0],
            m=structure.constraints.shape[0],
            cost_count=len(structure.cost.indices),
            constraint_count=len(structure.constraints.indices),
            condensed_rows=len(self.low),
        )
        owned = {name: getattr(self, name) for name in (*_PROBLEM, *_CONDENSED[1:])}
        for name, array in {**self._layout, **owned, "dynamics": self._dynamics, "room": self._room}.items():
            setattr(pointers, name, array.ctypes.data)
        self._pointers = pointers
        reference = ctypes.byref(pointers)

        def bound(name: str) -> Any:
            function = getattr(code, name)
            function.restype = None
            return lambda: function(reference)

        self._count_flaws, self._count_residuals = bound("flaws"), bound("residuals")
        self._condense, self._reduce, self._expand = bound("condense"), bound("reduce"), bound("expand")

    def _interpret(self) -> None:
        problem = [self.P, self.q, self.A, self.lower, self.upper]
        self._count_flaws = Kernel(checks.flaws(self._structure), problem, [self.flaws])
        self._count_residuals = Kernel(checks.residuals(self._structure), [*problem, self.x, self.y], [self.residuals])
        condensed = self._condensed
        if condensed is None:
            return
        self._reduce = Kernel(condensed.reduce, [*problem, self.U], [self.f, self.low, self.high])
        self._expand = Kernel(condensed.expand, [self.z, self.multipliers, self.U, *problem[:4]], [self.x, self.y])
        self._axes = [Kernel(condensed.condense) for _ in condensed.own_rows]
        self._condense = self._condense_axes

    def _condense_axes(self) -> None:
        assert self._condensed is not None
        condensed, stages = self._condensed, self._structure.setting.stages
        cost, constraints = np.append(self.P, 0.0), np.append(self.A, 0.0)
        for axis, kernel in enumerate(self._axes):
            kernel.inputs[0][:] = cost[condensed.cost_sources[axis]]
            kernel.inputs[1][:] = constraints[condensed.constraint_sources[axis]]
            kernel.inputs[2][:] = condensed.dynamics[axis]
            kernel()
            inverse, own, shared = (values.reshape(-1, stages) for values in kernel.outputs)
            columns, rows = slice(axis * stages, (axis + 1) * stages), condensed.own_rows[axis]
            self.U[columns] = inverse
            self.M[rows, columns] = own[: rows.stop - rows.start]
            self.M[condensed.shared_rows, columns] = shared


def _loaded(path: Path | None) -> ctypes.CDLL | None:
    if path is None:
        return None
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        _log.warning("%s cannot be loaded (%s): the MPC's checks are interpreted", path, error)
        return None
