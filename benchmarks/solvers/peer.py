"""What a solver is to the comparison, and the instances it is compared on."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy import sparse

from controller.mpc.assembly import Instant
from controller.mpc.structure import Structure


class Instance(NamedTuple):
    """One step's problem, as the controller posed it: a copy of its own."""

    P: np.ndarray
    q: np.ndarray
    A: np.ndarray
    l: np.ndarray  # noqa: E741
    u: np.ndarray
    matrices_changed: bool
    instant: Instant


class Peer(Protocol):
    """Takes instances in their order; only `solve` is timed."""

    def prepare(self, instance: Instance) -> Any:
        """Return the instance in the form the solver takes."""
        ...

    def solve(self, prepared: Any) -> np.ndarray | None:
        """Return the first input (4,), over its scale; None if it says it has none."""
        ...


class Sparse:
    """The matrices of instances as SciPy has them, the rows apart into equations and limits."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.equations = structure.dynamics

    def cost(self, instance: Instance) -> sparse.csc_matrix:
        cost = self.structure.cost
        return sparse.csc_matrix((instance.P, cost.indices, cost.indptr), cost.shape)

    def rows(self, instance: Instance) -> sparse.csc_matrix:
        constraints = self.structure.constraints
        return sparse.csc_matrix((instance.A, constraints.indices, constraints.indptr), constraints.shape)


def symmetric(upper: sparse.csc_matrix) -> sparse.csc_matrix:
    return sparse.csc_matrix(upper + sparse.triu(upper, 1).T)
