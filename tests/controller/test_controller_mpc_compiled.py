"""Model terms and problem as CasADi has them are Pinocchio's and NumPy's; as C they are CasADi's."""

from __future__ import annotations

import hashlib
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import Floats
from controller.admittance import Admittance
from controller.machine_limits import DRIVE_ROWS, TIP_ROWS, MachineLimits
from controller.mpc import compiled, condensing, symbolic_walker
from controller.mpc.assembly import Assembly, Instant
from controller.mpc.predictive_law import fading, structure_of
from controller.mpc.structure import DRIVE_SCALE, TIP_SCALE, Structure
from controller.mpc.workspace import Workspace
from controller.walker import Walker

CONFIG = MpcConfig()
# A frame whose centre of mass is off its middle couples what is apart in the default one.
WALKER = Walker(WalkerConfig(chassis_com_forward_m=0.03))
LIMITS = MachineLimits(WALKER)
FADING = fading(CONFIG)
ADMITTANCE = Admittance(AdmittanceConfig(), CONFIG.stage_s, FADING)


@pytest.fixture(scope="module")
def structure() -> Structure:
    return structure_of(WALKER.config, tuple(ADMITTANCE.mass.tolist()), CONFIG, 0.01)


def random_instant(random: np.random.Generator, push: float) -> Instant:
    profile = np.clip(np.linspace(random.normal(), random.normal(), CONFIG.stages), 0, 1)
    wrench = push * random.normal(0, [60, 60, 300, 10, 10, 10])
    velocity = np.array(WalkerConfig().velocity_max) * random.uniform(-0.6, 0.6, 4)
    height = float(random.uniform(0.75, 1.15))
    ADMITTANCE.reset()
    pose = np.array([0.0, 0.0, 0.0, height])
    force = wrench @ WALKER.terms.interface
    ADMITTANCE.stages(profile, pose, velocity, force)
    law = ADMITTANCE.stages(profile, pose + random.normal(0, [0.03, 0.03, 0.05, 0.01]), velocity, force)
    previous = np.array(WalkerConfig().acceleration_max) * random.uniform(-0.5, 0.5, 4)
    return Instant(law, wrench, random.normal(0, 5, 4), velocity, previous, height)


def test_terms_and_limits_are_those_of_pinocchio_and_numpy() -> None:
    height, velocity, wrench = ca.SX.sym("h"), ca.SX.sym("v", 4), ca.SX.sym("f", 6)
    at = symbolic_walker.terms(WALKER, height, velocity)
    rows = symbolic_walker.rows(WALKER, LIMITS, at)
    found = ca.Function(
        "found",
        [height, velocity, wrench],
        [*at, rows, *symbolic_walker.bounds(WALKER, LIMITS, at, rows, wrench, FADING)],
    )
    random = np.random.default_rng(0)
    gave_way = 0
    for _ in range(200):
        asked = random.uniform(0.7, 1.2), random.normal(size=4)
        push = random.choice([0.1, 1.0, 4.0]) * random.normal(0, [200, 200, 500, 50, 50, 50])
        terms = WALKER.evaluate(*asked)
        LIMITS.linearise(terms)
        bounds = LIMITS.bounds(terms, push, FADING)
        give_way = LIMITS.give_way(terms, push, bounds)
        gave_way += bool(give_way[:3].any())
        box = bounds.box_low[:, 3], bounds.box_high[:, 3]
        expected = [*terms, LIMITS.rows, bounds.low[:, DRIVE_ROWS].T, bounds.high.T, *box, give_way]
        for one, other in zip(found(*asked, push), expected, strict=True):
            np.testing.assert_allclose(np.array(one).squeeze(), other, rtol=1e-9, atol=1e-9)
    assert gave_way > 50


def test_the_problems_limits_are_those_of_the_machine(structure: Structure) -> None:
    """Where the give-way motion stays inside them, bounds are the machine's to the digit; else they are only wider."""
    random = np.random.default_rng(1)
    assembly = Assembly(structure, compile_c=False)
    for push in (0.3, 0.3, 6.0):
        asked = random_instant(random, push)._replace(previous=np.zeros(4))
        problem = assembly.fill(asked)
        terms = WALKER.evaluate(asked.height_m, asked.velocity)
        LIMITS.linearise(terms)
        bounds = LIMITS.bounds(terms, asked.wrench, FADING)
        stages = list(structure.setting.sparse_stages)
        for kind, high, scale in (
            ("drive", bounds.high[stages, DRIVE_ROWS], DRIVE_SCALE),
            ("tip_over", bounds.high[:, TIP_ROWS], TIP_SCALE),
        ):
            opened = problem.u[structure.rows[kind]] - scale * high
            assert (opened >= -1e-12).all()
            if push < 1.0:
                np.testing.assert_allclose(opened, 0.0, atol=1e-12)
        np.testing.assert_allclose(assembly.tip_rows, LIMITS.rows[TIP_ROWS], atol=1e-12)
        np.testing.assert_allclose(assembly.tip_high, bounds.high[0, TIP_ROWS], atol=1e-12)


def test_c_and_casadis_machine_give_equal_problems(structure: Structure) -> None:
    random = np.random.default_rng(2)
    built, interpreted = Assembly(structure, compile_c=True), Assembly(structure, compile_c=False)
    for _ in range(20):
        asked = random_instant(random, 3.0)
        for one, other in zip(built.fill(asked), interpreted.fill(asked), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_loops_in_c_and_casadis_machine_give_equal_numbers(structure: Structure) -> None:
    random = np.random.default_rng(3)
    condensed = condensing.build(structure)
    built, interpreted = Workspace(structure, condensed), Workspace(structure, condensed, compile_c=False)
    if not built.compiled:
        pytest.skip("no C compiler on this machine")
    assembly = Assembly(structure)
    for _ in range(5):
        problem = assembly.fill(random_instant(random, 2.0))
        z, at_bounds = random.normal(size=len(built.z)), random.normal(size=len(built.multipliers))
        for workspace in (built, interpreted):
            workspace.take(problem, with_matrices=True)
            workspace.condense()
            workspace.reduce()
            workspace.z[:], workspace.multipliers[:] = z, at_bounds
            workspace.multipliers[workspace.low <= -condensing.OPEN] = np.abs(
                at_bounds[workspace.low <= -condensing.OPEN]
            )
            workspace.expand()
            workspace.count_flaws()
            workspace.count_residuals()
        for name in ("U", "M", "f", "low", "high", "x", "y", "flaws", "residuals"):
            np.testing.assert_allclose(getattr(built, name), getattr(interpreted, name), rtol=1e-9, atol=1e-9)


def test_the_condensed_form_is_the_problem_in_its_inputs(structure: Structure) -> None:
    """Cost and limits at random inputs, counted in the full problem and in the condensed one."""
    random = np.random.default_rng(4)
    condensed = condensing.build(structure)
    workspace = Workspace(structure, condensed)
    workspace.take(Assembly(structure).fill(random_instant(random, 1.0)), with_matrices=True)
    workspace.condense()
    workspace.reduce()
    costs = []
    for _ in range(4):
        workspace.z[:] = random.normal(size=len(workspace.z))
        workspace.expand()
        x = workspace.x
        limited = matrix(structure, workspace.A) @ x
        np.testing.assert_allclose(limited[: structure.dynamics], workspace.lower[: structure.dynamics], atol=1e-9)
        slack = workspace.upper[condensed.order] - limited[condensed.order]
        np.testing.assert_allclose(workspace.high - workspace.M @ workspace.z, slack, rtol=1e-9, atol=1e-9)
        upper = cost(structure, workspace.P)
        quadratic = 0.5 * x @ (upper + np.triu(upper, 1).T) @ x + workspace.q @ x
        costs.append(quadratic - (0.5 * workspace.z @ workspace.z + workspace.f @ workspace.z))
    np.testing.assert_allclose(costs, costs[0], rtol=1e-9)


def matrix(structure: Structure, values: Floats) -> Floats:
    pattern = structure.constraints
    dense = np.zeros(pattern.shape)
    for column in range(pattern.shape[1]):
        where = slice(pattern.indptr[column], pattern.indptr[column + 1])
        dense[pattern.indices[where], column] = values[where]
    return dense


def cost(structure: Structure, values: Floats) -> Floats:
    pattern = structure.cost
    dense = np.zeros(pattern.shape)
    for column in range(pattern.shape[1]):
        where = slice(pattern.indptr[column], pattern.indptr[column + 1])
        dense[pattern.indices[where], column] = values[where]
    return dense


def square() -> Any:
    x = ca.SX.sym("x", 2)
    return ca.Function("square", [x], [x * x])


def called(function: Any) -> list[float]:
    kernel = compiled.Kernel(function)
    kernel.inputs[0][:] = 2.0, 3.0
    kernel()
    result: list[float] = kernel.outputs[0].tolist()
    return result


def test_a_machine_without_a_compiler_interprets(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert "no C compiler" in caplog.text


def test_a_compiler_that_fails_is_said_and_interpreted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("SUREFOOT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("CC", "false")
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert "could not be built" in caplog.text
    assert list((tmp_path / "cache").iterdir()) == []


def test_code_is_built_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SUREFOOT_CACHE", str(tmp_path))
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    (built,) = tmp_path.glob("*.so")
    stamp = built.stat().st_mtime_ns
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert built.stat().st_mtime_ns == stamp


@pytest.mark.parametrize("left", [0, 100, 4096, None], ids=["empty", "100 bytes", "a page", "no seal"])
def test_a_library_that_a_power_cut_left_damaged_is_built_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, left: int | None
) -> None:
    monkeypatch.setenv("SUREFOOT_CACHE", str(tmp_path))
    text = compiled.source("surefoot_kernels", [square()])
    path = compiled.library(text, "-O1")
    assert path is not None
    whole = path.read_bytes()
    assert len(whole) > 4096
    if left is None:
        path.with_suffix(".sha256").unlink()
    path.write_bytes(whole[:left])
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert path.read_bytes() == whole


def test_a_library_that_cannot_be_loaded_is_said_and_interpreted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, structure: Structure, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("SUREFOOT_CACHE", str(tmp_path))
    # Built and not yet loaded: what a process has loaded once it keeps, whatever becomes of the file.
    loops = resources.files("controller.mpc").joinpath("loops.c").read_text("utf-8")
    for path in (compiled.library(compiled.source("surefoot_kernels", [square()]), "-O1"), compiled.library(loops)):
        assert path is not None
        path.write_bytes(b"no library")  # as on a file system that nothing may be executed from
        path.with_suffix(".sha256").write_text(hashlib.sha256(b"no library").hexdigest())
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert not Workspace(structure).compiled
    assert caplog.text.count("cannot be loaded") == 2


def test_a_cache_that_others_may_write_to_is_not_trusted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("SUREFOOT_CACHE", str(shared))
    assert called(compiled.compiled([square()])[0]) == [4.0, 9.0]
    assert "may be written by others" in caplog.text
    assert list(shared.iterdir()) == []
