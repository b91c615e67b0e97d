"""Writes the folder: generated code, this configuration's numbers, OSQP's sources and workspace."""

from __future__ import annotations

import shutil
import tempfile
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import osqp

from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from controller.admittance import Admittance, AdmittanceStages
from controller.mpc.assembly import RELINEARISE_M, Assembly, Instant
from controller.mpc.osqp_solver import INFINITY, bindings
from controller.mpc.predictive_law import fading, structure_of
from controller.mpc.solver import clipped
from controller.mpc.structure import Structure
from controller.mpc.workspace import Workspace

_OWN = ("surefoot_mpc.h", "surefoot_mpc.c", "main.c", "README.md")
_PREFIX = "surefoot_osqp_"


def export(config: SurefootConfig, folder: Path) -> None:
    """Write the MPC of a configuration as C; the folder appears whole or not at all.

    Raises:
        SurefootError: the folder is there already and not empty, or cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SurefootError(f"{folder} exists and is not an empty folder: name a new one")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as scratch:
            inside = Path(scratch) / folder.name
            inside.mkdir()
            _write(config, inside)
            if folder.exists():
                folder.rmdir()
            inside.rename(folder)
    except OSError as error:
        raise SurefootError(f"{folder} cannot be written: {error.strerror or error}") from error


def _write(config: SurefootConfig, folder: Path) -> None:
    admittance = Admittance(config.admittance, config.mpc.stage_s, fading(config.mpc))
    structure = structure_of(config.walker, config.admittance.mass, config.mpc, 1.0 / config.controller.rate_hz)
    for name in _OWN:
        text = resources.files("controller.mpc.export").joinpath(name).read_text("utf-8")
        (folder / name).write_text(text, encoding="utf-8")
    loops = resources.files("controller.mpc").joinpath("loops.c").read_text("utf-8")
    (folder / "loops.c").write_text(loops, encoding="utf-8")
    _write_kernels(structure, folder)
    (folder / "surefoot_layout.h").write_text(_layout(structure, config), encoding="utf-8")
    _write_osqp(structure, config, folder / "osqp", admittance)


def _write_kernels(structure: Structure, folder: Path) -> None:
    generator = ca.CodeGenerator("surefoot_kernels", {"with_header": True})
    generator.add(structure.matrices)
    generator.add(structure.vectors)
    generator.generate(f"{folder}/")


def _layout(structure: Structure, config: SurefootConfig) -> str:
    cost, constraints = structure.cost, structure.constraints
    sizes: dict[str, Any] = {
        "STAGES": structure.setting.stages,
        "N": cost.shape[0],
        "M": constraints.shape[0],
        "COST_COUNT": len(cost.indices),
        "CONSTRAINT_COUNT": len(constraints.indices),
        "STEP_SIZE": repr(config.mpc.step_size),
        "RESIDUAL_MAX": repr(config.mpc.residual_max),
        "RELINEARISE_M": repr(RELINEARISE_M),
    }
    for function in (structure.matrices, structure.vectors):
        for name in ("arg", "res", "iw", "w"):
            sizes[f"{function.name()}_{name}".upper()] = getattr(function, f"sz_{name}")()
    lines = ["/* Sizes, patterns and scales of one configuration. */", "#ifndef SUREFOOT_LAYOUT_H"]
    lines += ["#define SUREFOOT_LAYOUT_H", *(f"#define SUREFOOT_{name} {value}" for name, value in sizes.items())]
    for name, values in (
        ("cost_columns", cost.indptr),
        ("cost_rows", cost.indices),
        ("constraint_columns", constraints.indptr),
        ("constraint_rows", constraints.indices),
    ):
        lines.append(f"static const int surefoot_{name}[] = {{{','.join(map(str, values.tolist()))}}};")
    scale = ",".join(repr(value) for value in structure.setting.acceleration.tolist())
    lines += [f"static const double surefoot_acceleration[] = {{{scale}}};", "#endif", ""]
    return "\n".join(lines)


def _write_osqp(structure: Structure, config: SurefootConfig, folder: Path, admittance: Admittance) -> None:
    """Write OSQP's sources with a workspace set up on the problem of a walker at rest."""
    stages = structure.setting.stages
    pose = np.array([0.0, 0.0, 0.0, config.admittance.height_hold_m])
    law: AdmittanceStages = admittance.stages(np.zeros(stages), pose, np.zeros(4), np.zeros(4))
    instant = Instant(law, np.zeros(6), np.zeros(4), np.zeros(4), np.zeros(4), float(pose[3]))
    workspace = Workspace(structure, compile_c=False)
    workspace.take(Assembly(structure, compile_c=False).fill(instant), with_matrices=True)
    low, high = (clipped(bound, INFINITY, np.zeros_like(bound)) for bound in (workspace.lower, workspace.upper))
    with resources.as_file(resources.files("osqp.codegen") / "codegen_src") as sources:
        shutil.copytree(sources, folder)
    module: Any = osqp.OSQP().ext
    defines = module.OSQPCodegenDefines()
    module.osqp_set_default_codegen_defines(defines)
    defines.embedded_mode = 2  # matrices are updated too
    failed = bindings(structure, config.mpc, workspace, low, high).codegen(f"{folder}/", _PREFIX, defines)
    if failed:
        raise SurefootError(f"OSQP's code generation failed with code {failed}")
    # OSQP's own example and build file have nothing to do with this folder's.
    for name in ("emosqp.c", "Makefile"):
        (folder / name).unlink(missing_ok=True)
