"""The exported C takes the steps that the Python controller takes."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_loop import PERIOD_S, Loop

from bridge.cli import main
from bridge.config.load import load_config
from controller.mpc.assembly import Instant
from controller.mpc.export.writer import export
from controller.mpc.plan import Failure, Plan

COMPILER = shutil.which("cc")
CONFIG = load_config(None, ["mpc.solver='osqp'", "mpc.time_limit_s=0.1"])
STEPS = 1000
# The same iterations in the same order; what differs is how two compilers round sums, which ADMM does not amplify.
TOLERANCE = 1e-7


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("codegen") / "mpc"
    export(CONFIG, path)
    return path


@pytest.fixture(scope="module")
def program(folder: Path) -> Path:
    """The program, built with the very line that the folder's README gives, optimised less: the test is short."""
    if COMPILER is None:
        pytest.skip("no C compiler (cc) on this machine")
    readme = (folder / "README.md").read_text()
    line = next(line.strip() for line in readme.splitlines() if line.strip().startswith("cc "))
    subprocess.run(line.replace("-O2", "-O1"), shell=True, cwd=folder, check=True, capture_output=True)
    return folder / "surefoot_mpc"


def numbers(instant: Instant) -> list[float]:
    law = instant.law
    parts: list[Any] = [instant.height_m, instant.velocity, instant.previous, instant.wrench, instant.draw]
    parts += [law.damping, law.stiffness, law.load]
    return [float(value) for part in parts for value in np.ravel(part)]


def stepped(program: Path, instants: list[list[float]]) -> list[tuple[int, int, np.ndarray, str]]:
    text = "\n".join(" ".join(f"{value:.17g}" for value in values) for values in instants)
    out = subprocess.run([program], input=text, capture_output=True, text=True, check=True, timeout=60).stdout
    rows = [line.split(maxsplit=6) for line in out.splitlines()]
    return [(int(row[0]), int(row[1]), np.array([float(value) for value in row[2:6]]), row[6]) for row in rows]


class Listening:
    """A predictive law that keeps what it was asked and what it answered."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner
        self.asked: list[tuple[list[float], Plan | Failure]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def plan(self, instant: Instant) -> Plan | Failure:
        values = numbers(instant)
        outcome = self.inner.plan(instant)
        self.asked.append((values, outcome))
        return outcome


def scene(loop: Loop) -> None:
    """Walk with a sway, be pushed to the side and held in the harness, stiff as foreseen 300 ms before."""
    ahead = CONFIG.mpc.stage_s * np.arange(CONFIG.mpc.stages)
    for k in range(STEPS):
        t = k * PERIOD_S
        phase = t % 2.5
        wrench = np.array(
            [25 + 15 * np.sin(11 * t), 10 * np.sin(5.5 * t), -30 - 20 * np.sin(11 * t), 0, 0, 3 * np.sin(5 * t)]
        )
        if 0.8 < phase < 1.05:
            wrench[1] += 60.0 * (1 + t) * np.sin(np.pi * (phase - 0.8) / 0.25)
        if 1.4 < phase < 2.0:
            wrench[2] -= 800.0 * min(1.0, (phase - 1.4) / 0.1, (2.0 - phase) / 0.2)
        profile = np.clip(8.0 * (phase + ahead - 1.1), 0.0, 1.0) * np.clip(1.0 - 2.0 * (phase + ahead - 2.0), 0.0, 1.0)
        loop.step(wrench, profile)


def test_a_thousand_steps_are_those_of_python(program: Path) -> None:
    loop = Loop(mpc=CONFIG.mpc, lag_s=0.05)
    listening = Listening(loop.controller._predictive)
    loop.controller._predictive = listening  # type: ignore[assignment]
    scene(loop)
    assert len(listening.asked) == STEPS
    answers = stepped(program, [values for values, _ in listening.asked])
    assert len(answers) == STEPS
    scale = np.array(CONFIG.walker.acceleration_max)
    worst, hard = 0.0, 0
    for (_, outcome), (status, iterations, acceleration, reason) in zip(listening.asked, answers, strict=True):
        assert isinstance(outcome, Plan) == (status == 0), (outcome, reason)
        if isinstance(outcome, Plan):
            assert iterations == outcome.iterations
            hard += iterations > 50
            worst = max(worst, float(np.abs((acceleration - outcome.acceleration[0]) / scale).max()))
    assert worst < TOLERANCE
    assert hard > 0, "no step made the step size adapt: the scene is too easy to prove anything"


def test_faults_are_named_and_the_next_step_is_clean(program: Path) -> None:
    loop = Loop(mpc=CONFIG.mpc)
    listening = Listening(loop.controller._predictive)
    loop.controller._predictive = listening  # type: ignore[assignment]
    loop.run(0.05, [20.0, 5.0, 0, 0, 0, 0])
    good = listening.asked[-1][0]
    steps = [good]
    for place in range(19):  # height, velocities, accelerations, wrench, draw
        bad = list(good)
        bad[place] = float("nan")
        steps += [bad, good]
    answers = stepped(program, steps)
    for status, _, acceleration, reason in answers[1::2]:
        assert (status, reason) == (1, "the problem is not finite")
        assert not acceleration.any()
    first = answers[0][2]
    for status, _, acceleration, _ in answers[2::2]:
        assert status == 0
        np.testing.assert_allclose(acceleration, first, atol=1e-3)


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    assert main(["codegen", "--out", str(tmp_path)]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_the_command_writes_the_folder_whole(tmp_path: Path) -> None:
    out = tmp_path / "new" / "mpc"
    assert main(["codegen", "--out", str(out), "--set", "walker.chassis_mass_kg=80"]) == 0
    assert {path.name for path in out.iterdir()} >= {"README.md", "main.c", "surefoot_mpc.c", "osqp", "loops.c"}
    assert [path.name for path in out.parent.iterdir()] == ["mpc"]
