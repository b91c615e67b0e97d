"""Whether the MPC can be compiled, and whether pictures can be drawn without a screen."""

from __future__ import annotations

import ctypes
import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from bridge.doctor.finding import Finding, Level, Patient

COMPILER: Final = "compiler"
RENDERING: Final = "rendering"
_PROBE: Final = "int surefoot_probe(void) { return 42; }\n"
_DRAW: Final = """\
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='0.1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = mujoco.Renderer(model, 32, 32)
renderer.update_scene(data)
assert renderer.render().shape == (32, 32, 3)
renderer.close()
"""


def check_compiler(patient: Patient) -> Iterator[Finding]:
    """Whether C code can be built into the cache and loaded from it, as the MPC's is."""
    if patient.config.controller.kind != "mpc" or not patient.config.mpc.compile_c:
        yield Finding(COMPILER, Level.NOTE, "not needed: the configuration compiles nothing")
        return
    # by its name: the bridge imports no other package
    yield judge_compiler(importlib.import_module("controller.mpc.compiled"))


def judge_compiler(compiled: Any) -> Finding:
    """Return the finding for building and loading a line of C with the module `compiled`."""
    slower = "the MPC is interpreted: 0.68 ms a step instead of 0.28"
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return Finding(COMPILER, Level.WARNING, f"no cc, gcc or $CC: {slower}", "sudo apt install gcc libc6-dev")
    try:
        folder: Path = compiled.cache_folder()
    except (OSError, RuntimeError) as error:
        mend = "export SUREFOOT_CACHE=FOLDER, one that you alone may write"
        return Finding(COMPILER, Level.WARNING, f"the cache cannot be used ({error}): {slower}", mend)
    path: Path | None = compiled.library(_PROBE, "-O0")
    if path is None:
        text = f"{compiler} does not build into {folder}: {slower}"
        return Finding(COMPILER, Level.WARNING, text, f"echo 'int f;' | {compiler} -shared -fPIC -x c - -o f.so")
    try:
        works = ctypes.CDLL(str(path)).surefoot_probe() == 42
    except OSError as error:
        mend = "export SUREFOOT_CACHE=FOLDER, on a disk that is not mounted noexec"
        return Finding(COMPILER, Level.WARNING, f"what is built in {folder} cannot be run ({error}): {slower}", mend)
    finally:
        for made in path.parent.glob(f"{path.stem}.*"):
            made.unlink(missing_ok=True)
    if not works:
        return Finding(COMPILER, Level.BROKEN, f"{compiler} builds code that computes wrongly", "sudo apt install gcc")
    return Finding(COMPILER, Level.GOOD, f"{compiler}, cache {folder}")


def check_rendering(patient: Patient) -> Iterator[Finding]:
    """Whether MuJoCo draws without a screen, as the film of `surefoot demo` needs."""
    del patient
    yield judge_rendering({"MUJOCO_GL": "egl", **os.environ})


def judge_rendering(environment: Mapping[str, str]) -> Finding:
    """Return the finding for a picture drawn by a process with `environment`: a broken driver takes it along."""
    way = environment.get("MUJOCO_GL", "")
    done = subprocess.run(  # noqa: S603 (ourselves)
        [sys.executable, "-c", _DRAW], env=dict(environment), capture_output=True, text=True, timeout=60, check=False
    )
    if done.returncode == 0:
        return Finding(RENDERING, Level.GOOD, f"MuJoCo draws off screen (MUJOCO_GL={way})")
    lines = [line for line in done.stderr.strip().splitlines() if not line.startswith(("Exception ignored", " "))]
    why = lines[-1] if lines else f"exit code {done.returncode}"
    text = f"MuJoCo cannot draw off screen with MUJOCO_GL={way} ({why}): surefoot demo makes no film"
    return Finding(RENDERING, Level.WARNING, text, "sudo apt install libegl1 libgl1-mesa-dri; then MUJOCO_GL=egl")
