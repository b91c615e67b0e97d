"""The solvers by the names they have in the configuration, each imported where it is asked for."""

from __future__ import annotations

import importlib
from typing import Final

from bridge.config.mpc import MpcConfig
from bridge.errors import MissingExtraError
from controller.mpc import condensing
from controller.mpc.solver import Solver
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

SOLVERS: Final = {
    "daqp": "controller.mpc.daqp_solver:DaqpSolver",
    "osqp": "controller.mpc.osqp_solver:OsqpSolver",
    "piqp": "controller.mpc.piqp_solver:PiqpSolver",
}


def create(structure: Structure, config: MpcConfig) -> Solver:
    """Return the solver that `mpc.solver` names.

    Raises:
        MissingExtraError: its package is not installed.
    """
    module, _, name = SOLVERS[config.solver].partition(":")
    try:
        found = getattr(importlib.import_module(module), name)
    except ModuleNotFoundError as error:
        if error.name != config.solver:
            raise
        raise MissingExtraError(f"mpc.solver = '{config.solver}'", config.solver, "solvers") from error
    condensed = condensing.build(structure) if config.solver == "daqp" else None
    solver: Solver = found(structure, config, Workspace(structure, condensed, config.compile_c))
    return solver
