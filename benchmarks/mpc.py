"""One control step against other solvers, on the same instances: a walking person, pushes, stiffening, a fall held.

    python -m benchmarks.mpc --json runs/bench/mpc.json

`ours` is timed whole in closed loop (judging inputs, model terms, admittance, limits, problem, solve, check, limiter),
with each solver that the configuration offers; `ours` itself is the default one. Every problem that it posed is kept
and given to the others in the same order; of them only update and solve are timed, not the conversion into the form
each takes. Times are of the thread: on a machine that does other things they say what a step costs; for `ours` the
wall's are printed too. The first input is compared with a solution to 1e-9 of the same problem, over its limit.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import json
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import osqp

from benchmarks.report import percentiles
from benchmarks.solvers.peer import Instance, Peer, Sparse
from bridge.clock import NS
from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.errors import SurefootError
from bridge.messages import GaitState, Odometry, Wrench
from controller.admittance_controller import AdmittanceController
from controller.interface import Decision
from controller.mpc.assembly import Instant
from controller.mpc.plan import Failure, Plan
from controller.mpc.structure import Structure

Row = dict[str, Any]
PERIOD_S = 0.01
MEDIAN_MS, P99_MS, ERROR, RATIO = 0.30, 0.7, 1e-3, 1.5  # targets of the whole step
CYCLE_S = 3.0  # walk, be pushed, stiffen, hang in the harness, stand up again
REFERENCE_EVERY = 10
SLOW_EVERY = 10  # IPOPT sees every tenth instance
PEERS = {
    "osqp_anew": ("benchmarks.solvers.osqp_peers:OsqpAnew", "osqp"),
    "casadi_conic_osqp": ("benchmarks.solvers.osqp_peers:CasadiConic", "casadi"),
    "piqp": ("benchmarks.solvers.piqp_peer:Piqp", "piqp"),
    "daqp": ("benchmarks.solvers.dense_peers:Daqp", "daqp"),
    "proxqp": ("benchmarks.solvers.proxqp_peer:ProxQp", "proxsuite"),
    "do_mpc_ipopt": ("benchmarks.solvers.do_mpc_peer:DoMpc", "do-mpc"),
    "one_step_law": ("benchmarks.solvers.dense_peers:OneStep", "numpy"),
}


class Scene:
    """A walking person: sway of 1.8 steps a second, a push, a fall into the harness foreseen by 300 ms."""

    SIDE = (80.0, -120.0, 200.0, -300.0)  # peak of successive cycles' sideward push; the last would tip the walker [N]
    FORE = (150.0, -100.0, 0.0, 250.0)  # forward pull while hanging [N]

    def __init__(self, stages: int, stage_s: float) -> None:
        self._ahead = stage_s * np.arange(stages)
        self._random = np.random.default_rng(0)

    def wrench(self, t: float) -> np.ndarray:
        """Force and torque (6,) at `t` [N, N m]."""
        phase, cycle = t % CYCLE_S, int(t // CYCLE_S) % 4
        sway = np.sin(2 * np.pi * 1.8 * t)
        half = np.sin(2 * np.pi * 0.9 * t)
        wrench = np.array([25 + 15 * sway, 10 * half, -30 - 20 * sway, 0.0, 0.0, 3 * half])
        wrench += self._random.normal(0, [1.5, 1.5, 1.5, 0.2, 0.2, 0.4])
        if 1.0 < phase < 1.25:
            wrench[1] += self.SIDE[cycle] * np.sin(np.pi * (phase - 1.0) / 0.25)
        if 1.6 < phase < 2.4:
            # Falls into the harness within 100 ms, stands up again within 200.
            hanging = min(1.0, (phase - 1.6) / 0.1, (2.4 - phase) / 0.2)
            wrench[2] -= 900.0 * hanging
            wrench[0] += self.FORE[cycle] * hanging
        return wrench

    def profile(self, t: float) -> np.ndarray:
        """Stiffening (N,) at `t` and ahead of it: up within 125 ms, released over two thirds of a second."""
        phase = t % CYCLE_S + self._ahead
        return np.clip(8.0 * (phase - 1.3), 0.0, 1.0) * np.clip(1.0 - 1.5 * (phase - 2.6), 0.0, 1.0)


class Run(NamedTuple):
    """One controller through the scene."""

    wall_ms: list[float]
    core_ms: list[float]
    iterations: list[int]
    unsolved: list[str]  # reasons
    instances: list[Instance]
    inputs: dict[int, np.ndarray]  # step -> first input over its scale
    structure: Structure


def run(config: MpcConfig, seconds: float) -> Run:
    """Drive a controller through the scene and keep what it was asked and what it answered."""
    walker = WalkerConfig()
    controller = AdmittanceController(walker, AdmittanceConfig(), config, PERIOD_S)
    law = controller.predictive_law
    asked: list[tuple[Instant, Plan | Failure]] = []
    plan = law.plan

    def listening(instant: Instant) -> Plan | Failure:
        outcome = plan(instant)
        asked.append((instant, outcome))
        return outcome

    law.plan = listening  # type: ignore[method-assign]
    scene = Scene(config.stages, config.stage_s)
    scale = np.array(walker.acceleration_max)
    pose, velocity, now_ns = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(4), NS
    result = Run([], [], [], [], [], {}, law.structure)
    gc.collect()
    gc.freeze()
    gc.disable()
    for k in range(round(seconds / PERIOD_S)):
        t = k * PERIOD_S
        w = scene.wrench(t)
        profile = scene.profile(t)
        odometry = Odometry(
            stamp_ns=now_ns,
            position=np.array([pose[0], pose[1], pose[3]]),
            yaw=float(pose[2]),
            velocity=np.array([velocity[0], velocity[1], velocity[3]]),
            yaw_rate=float(velocity[2]),
        )
        wrench = Wrench(stamp_ns=now_ns, force=w[:3], torque=w[3:])
        decision = Decision(GaitState.FOLLOW, "", float(profile[0]), profile, 1.0, 0.0, now_ns)
        asked.clear()
        wall_0, core_0 = time.perf_counter(), time.thread_time()
        command = controller.step(now_ns, odometry, wrench, decision)
        result.core_ms.append(1e3 * (time.thread_time() - core_0))
        result.wall_ms.append(1e3 * (time.perf_counter() - wall_0))
        instant, outcome = asked[0]
        posed = law.last_problem
        result.instances.append(
            Instance(*(np.array(part) for part in posed[:5]), posed.matrices_changed, _kept(instant))
        )
        if isinstance(outcome, Plan):
            result.iterations.append(outcome.iterations)
            result.inputs[k] = outcome.acceleration[0] / scale
        else:
            result.unsolved.append(outcome.reason)
        velocity = velocity + (command.velocity - velocity) * (1.0 - np.exp(-PERIOD_S / 0.05))
        heading = pose[2]
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        pose = pose + PERIOD_S * np.concatenate([turn @ velocity[:2], velocity[2:]])
        now_ns += int(PERIOD_S * NS)
    gc.enable()
    return result


def _kept(instant: Instant) -> Instant:
    law = instant.law._replace(**{name: np.array(values) for name, values in instant.law._asdict().items()})
    return Instant(law, *(np.array(part) for part in instant[1:5]), instant.height_m)


def references(structure: Structure, instances: list[Instance], every: int) -> dict[int, np.ndarray]:
    """Return the first inputs of every so-manieth instance, solved to 1e-9 by OSQP from nothing."""
    sparse, found = Sparse(structure), {}
    for k in range(0, len(instances), every):
        instance = instances[k]
        solver = osqp.OSQP()
        solver.setup(
            sparse.cost(instance),
            instance.q,
            sparse.rows(instance),
            instance.l,
            instance.u,
            verbose=False,
            eps_abs=1e-9,
            eps_rel=1e-9,
            max_iter=200_000,
        )
        result = solver.solve(raise_error=False)
        if result.info.status_val != 1:
            raise SystemExit(f"no reference for instance {k}: {result.info.status}")
        found[k] = np.array(result.x[:4])
    return found


def measure_peer(peer: Peer, instances: list[Instance], every: int) -> tuple[list[float], dict[int, np.ndarray], int]:
    """Return times [ms], first inputs and how many instances went unsolved."""
    times, inputs, unsolved = [], {}, 0
    gc.collect()
    gc.disable()
    for k in range(0, len(instances), every):
        prepared = peer.prepare(instances[k])
        start = time.thread_time()
        answer = peer.solve(prepared)
        times.append(1e3 * (time.thread_time() - start))
        if answer is None:
            unsolved += 1
        else:
            inputs[k] = answer
    gc.enable()
    return times, inputs, unsolved


def row(times_ms: list[float], inputs: dict[int, np.ndarray], exact: dict[int, np.ndarray], unsolved: int) -> Row:
    """Return one solver's line of the table."""
    found = percentiles(times_ms)
    errors = [float(np.abs(inputs[k] - exact[k]).max()) for k in exact if k in inputs]
    return {
        "median_ms": found["p50_ms"],
        "p99_ms": found["p99_ms"],
        "max_ms": found["max_ms"],
        "max_error_u0": max(errors, default=None),
        "unsolved": unsolved,
    }


def compare(seconds: float, say: Callable[[str], None]) -> dict[str, Row]:
    """Measure everything; print as it goes."""
    table: dict[str, Row] = {}
    ours: Run | None = None
    exact: dict[int, np.ndarray] = {}
    default = MpcConfig().solver
    for name in (default, *(name for name in ("osqp", "piqp") if name != default)):
        key = "ours" if name == default else f"ours_{name}"
        try:
            found = run(MpcConfig(solver=name), seconds)
        except SurefootError as error:
            table[key] = missing(str(error))
            continue
        if ours is None:
            ours = found
            exact = references(ours.structure, ours.instances, REFERENCE_EVERY)
            own = exact
        else:
            own = references(found.structure, found.instances, 10 * REFERENCE_EVERY)
        table[key] = row(found.core_ms, found.inputs, own, len(found.unsolved))
        wall = percentiles(found.wall_ms)
        spent = np.percentile(found.iterations, [50, 99, 100])
        say(
            f"{key} ({name}), on the wall: "
            f"median {wall['p50_ms']:.3f}, p99 {wall['p99_ms']:.3f}, max {wall['max_ms']:.3f} ms; "
            f"iterations median {spent[0]:.0f}, p99 {spent[1]:.0f}, max {spent[2]:.0f}; "
            f"matrices changed in {sum(i.matrices_changed for i in found.instances)} of {len(found.instances)} steps"
            + "".join(f"; unsolved: {reason}" for reason in sorted(set(found.unsolved)))
        )
    assert ours is not None
    warnings.simplefilter("ignore")  # do-mpc speaks of features that nobody asked for
    for name, (target, package) in PEERS.items():
        module, _, attribute = target.partition(":")
        try:
            peer = getattr(importlib.import_module(module), attribute)(ours.structure)
        except ModuleNotFoundError as error:
            table[name] = missing(f"needs the package '{package}': pip install 'surefoot[bench]' ({error})")
            continue
        every = SLOW_EVERY if name == "do_mpc_ipopt" else 1
        times, inputs, unsolved = measure_peer(peer, ours.instances, every)
        table[name] = row(times, inputs, exact, unsolved)
    return table


def missing(reason: str) -> Row:
    """Return the line of a solver that is not installed."""
    return {
        "median_ms": None,
        "p99_ms": None,
        "max_ms": None,
        "max_error_u0": None,
        "unsolved": None,
        "missing": reason,
    }


def verdict(table: dict[str, Row]) -> list[str]:
    """Return each target with what was measured."""
    ours = table["ours"]
    exact = [
        (line["p99_ms"], name)
        for name, line in table.items()
        if not name.startswith("ours")
        and "missing" not in line
        and (line["max_error_u0"] or 0.0) <= ERROR
        and line["unsolved"] == 0
    ]
    best, who = min(exact, default=(float("nan"), "none"))
    lines = [
        (f"median {ours['median_ms']:.3f} ms, target {MEDIAN_MS}", ours["median_ms"] <= MEDIAN_MS),
        (f"p99 {ours['p99_ms']:.3f} ms, target {P99_MS}", ours["p99_ms"] <= P99_MS),
        (f"error of u0 {ours['max_error_u0']:.1e}, target {ERROR:g}", ours["max_error_u0"] <= ERROR),
        (
            f"p99 {ours['p99_ms'] / best:.2f} times that of the best peer as exact ({who}), target {RATIO}",
            ours["p99_ms"] <= RATIO * best,
        ),
    ]
    return [f"{'met   ' if met else 'MISSED'}  {text}" for text, met in lines]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--seconds", type=float, default=24.0, help="simulated time, 100 steps a second")
    arguments = parser.parse_args()
    table = compare(arguments.seconds, print)
    print(f"{'':18s} {'median':>8s} {'p99':>8s} {'max':>8s} ms  {'error u0':>9s}  unsolved")
    for name, line in table.items():
        if "missing" in line:
            print(f"{name:18s} missing: {line['missing']}")
            continue
        error = float("nan") if line["max_error_u0"] is None else line["max_error_u0"]
        times = "  ".join(f"{line[key]:7.3f}" for key in ("median_ms", "p99_ms", "max_ms"))
        print(f"{name:18s} {times}     {error:9.1e}  {line['unsolved']}")
    print("\n".join(verdict(table)))
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(table, indent=2) + "\n")


if __name__ == "__main__":
    main()
