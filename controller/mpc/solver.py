"""What every QP solver is to the controller: a way to an answer that is checked here, whatever the solver says of it.

A solver is given a problem's numbers in a workspace and leaves x and y there with a word on how it went. Whether
that is a plan is decided by the residuals, counted without it. After a failure it starts anew: iterates of an
infeasible problem are rays or worse, and a warm start from them would poison every later solve.

`mpc.time_limit_s` bounds a solver's effort: it stops and has no answer, or one that the residuals decide on. An answer
that is right but late, because the system let the process wait, is a plan: lateness is the loop's to judge.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from bridge.config.mpc import MpcConfig
from bridge.messages import Floats
from controller.mpc.plan import Failure, Plan, Residuals
from controller.mpc.problem import Problem
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

INFEASIBLE = "the problem has no feasible motion"
UNBOUNDED = "the problem is unbounded"
ITERATIONS = "the solver reached its iteration limit"
TIME = "the solver reached its time limit"
FAILED = "the solver failed"


class Outcome(NamedTuple):
    """How a solver says it went. What it computed lies in the workspace."""

    status: str  # the solver's own word
    answered: bool  # whether x and y are worth looking at
    reason: str = ""  # why there is no answer, or why it may be short of one; '' if solved
    iterations: int = 0
    time_s: float = 0.0  # of update and solve, as far as the solver counts them


class Solver(ABC):
    """Solves problems of one structure, one after the other, each started from the last."""

    def __init__(self, structure: Structure, config: MpcConfig, workspace: Workspace) -> None:
        self.config = config
        self.structure = structure
        self.workspace = workspace
        self._scale = structure.scale
        self._stale = True

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._stale = True

    def solve(self, problem: Problem) -> Plan | Failure:
        """Return an accepted plan, or why there is none."""
        fresh, self._stale = self._stale, True
        workspace = self.workspace
        workspace.take(problem, with_matrices=fresh or problem.matrices_changed)
        workspace.count_flaws()
        flaw = _flaw(workspace)
        if flaw:
            return Failure(flaw, status="")
        outcome = self._answer(fresh, problem.matrices_changed)
        if not outcome.answered:
            return self._failure(outcome, outcome.reason or FAILED)
        workspace.count_residuals()
        primal, dual, gap, whole = workspace.residuals.tolist()
        if not math.isfinite(whole):
            return self._failure(outcome, "the solver's answer is not finite")
        residuals = Residuals(primal, dual, gap)
        limit = self.config.residual_max
        # What is not a number is not below the limit either.
        if not all(value <= limit for value in residuals):
            off = f"the answer is off by {max(residuals):.1e}, limit {limit:.1e}"
            return self._failure(outcome, f"{outcome.reason}, {off}" if outcome.reason else off, residuals)
        self._stale = False
        stages = workspace.x.reshape(self._scale.shape) * self._scale
        return Plan(stages, residuals, outcome.iterations, outcome.time_s)

    @abstractmethod
    def _answer(self, fresh: bool, matrices_changed: bool) -> Outcome:
        """Solve what is in the workspace; `fresh`: from nothing."""

    def _failure(self, outcome: Outcome, reason: str, residuals: Residuals | None = None) -> Failure:
        return Failure(reason, outcome.status, outcome.iterations, residuals, outcome.time_s)


def _flaw(workspace: Workspace) -> str:
    """Return what makes a problem none, '' if all is well."""
    P, q, A, crossed = workspace.flaws.tolist()
    if math.isfinite(P + q + A) and crossed == 0.0:
        return ""
    for name, value in (("P", P), ("q", q), ("A", A)):
        if not math.isfinite(value):
            return f"{name} of the problem is not finite"
    if np.isnan(workspace.lower).any() or np.isnan(workspace.upper).any():
        return "a bound of the problem is not a number"
    return "a lower bound of the problem exceeds its upper bound"


def clipped(values: Floats, most: float, out: Floats) -> Floats:
    """Return `values` with what a solver takes for infinite in the place of what is."""
    return np.minimum(np.maximum(values, -most, out=out), most, out=out)
