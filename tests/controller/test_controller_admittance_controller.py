"""The controller in closed loop: what the person feels, and what happens when something is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from controller_loop import MPC, NS, PERIOD_S, Loop, decision

from bridge.config.admittance import AdmittanceConfig
from bridge.config.mpc import MpcConfig
from bridge.config.walker import WalkerConfig
from bridge.errors import ConfigError
from bridge.messages import GaitState, SupportCommand, Wrench
from controller.admittance_controller import AdmittanceController
from controller.motion_limits import MotionLimits
from controller.mpc.plan import Failure
from controller.walker import Walker

WALKER, ADMITTANCE = WalkerConfig(), AdmittanceConfig()
LIMITS = MotionLimits(WALKER)
# Forces small enough that no limit of the machine is met.
SMALL = np.array([20.0, 15.0, 2.5, 100.0])
WRENCH_AXES = (0, 1, 5, 2)  # x, y, yaw, height among (force, torque)


def push(axis: int, value: float) -> np.ndarray:
    wrench = np.zeros(6)
    wrench[WRENCH_AXES[axis]] = value
    return wrench


def velocities(commands: list[SupportCommand]) -> np.ndarray:
    return np.array([command.velocity for command in commands])


# What is shipped, with a wrench that is expected to fade; only the wall clock decides nothing here.
SHIPPED = MpcConfig(time_limit_s=0.1)


@pytest.mark.parametrize("mpc", [MPC, SHIPPED], ids=["held", "shipped"])
@pytest.mark.parametrize("axis", range(3))
def test_free_walking_is_the_stated_mass_and_damper(axis: int, mpc: MpcConfig) -> None:
    loop = Loop(mpc=mpc)
    commands = loop.run(1.2, push(axis, SMALL[axis]))
    assert {command.solver for command in commands} == {"mpc"}
    time = PERIOD_S * np.arange(1, len(commands) + 1)
    mass, damping = ADMITTANCE.mass[axis], ADMITTANCE.damping_free[axis]
    expected = SMALL[axis] / damping * (1.0 - np.exp(-damping / mass * time))
    error = np.abs(velocities(commands)[:, axis] - expected).max() / expected.max()
    assert error < 0.02
    others = [other for other in range(4) if other != axis]
    np.testing.assert_allclose(velocities(commands)[:, others], 0.0, atol=2e-3)


def spring_response(mass: float, damping: float, stiffness: float, force: float, times: np.ndarray) -> np.ndarray:
    """Displacement of a mass on spring and damper after a step of force, from rest."""
    step = 2e-4
    p = v = 0.0
    out, clock = [], 0.0
    for time in times:
        while clock < time - step / 2:
            a = (force - damping * v - stiffness * p) / mass
            v += step * a
            p += step * v
            clock += step
        out.append(p)
    return np.array(out)


@pytest.mark.parametrize(("axis", "s"), [(3, 0.0), *((axis, s) for axis in range(4) for s in (0.4, 1.0))])
def test_constant_stiffening_is_the_stated_mass_spring_and_damper(axis: int, s: float) -> None:
    loop = Loop(admittance=AdmittanceConfig(take_up_force_n=0.0), mpc=SHIPPED)
    loop.run(0.1, np.zeros(6), s)
    start = loop.pose.copy()
    times = PERIOD_S * np.arange(1, 51)
    moved = []
    for _ in times:
        loop.step(push(axis, SMALL[axis]), s)
        moved.append(loop.pose[axis] - start[axis])
    free, arrest = ADMITTANCE.damping_free[axis], ADMITTANCE.damping_arrest[axis]
    stiffness = s**2 * ADMITTANCE.stiffness_arrest[axis]
    stiffness += ADMITTANCE.stiffness_hold_height_n_m if axis == 3 else 0.0
    expected = spring_response(ADMITTANCE.mass[axis], free + s * (arrest - free), stiffness, SMALL[axis], times)
    assert np.abs(np.array(moved) - expected).max() < 0.02 * np.abs(expected).max()


def test_the_column_holds_its_height_and_carries_a_person_who_falls_into_the_harness() -> None:
    """100 kg pulling from one moment to the next in ARREST: the column gives 10 cm at most and holds."""
    loop = Loop()
    loop.run(0.5, np.zeros(6))
    np.testing.assert_allclose(loop.pose[3], 1.0, atol=1e-3)
    loop.run(1.5, [0, 0, -981.0, 0, 0, 0], 1.0, state=GaitState.ARREST)
    drop = 1.0 - loop.pose[3]
    assert 0.01 < drop < 0.10
    assert abs(loop.velocity[3]) < 1e-2


@pytest.mark.parametrize("rise_per_s", [8.0, 20.0])
def test_a_person_descending_at_0_9_m_s_is_caught_within_10_cm(rise_per_s: float) -> None:
    """100 kg in a harness of 40 kN/m that goes taut as stiffening begins: pelvis drop, column and strap together."""
    loop = Loop(lag_s=0.03)
    loop.run(0.2, np.zeros(6))
    mass, stiffness, damping, dt = 100.0, 40e3, 800.0, 5e-4
    start = pelvis = loop.pose[3]
    speed, lowest, load = -0.9, 0.0, 0.0
    for k in range(100):
        before = loop.pose[3]
        loop.step([0, 0, -load, 0, 0, 0], min(1.0, rise_per_s * k * PERIOD_S), GaitState.ARREST)
        for fine in range(1, 21):
            bar = before + (loop.pose[3] - before) * fine / 20
            taut = bar - pelvis
            load = max(0.0, stiffness * taut + damping * (loop.velocity[3] - speed)) if taut > 0 else 0.0
            speed += dt * (load / mass - WALKER.gravity_m_s2)
            pelvis += dt * speed
        lowest = min(lowest, pelvis - start)
    assert lowest > -0.10
    assert load == pytest.approx(mass * WALKER.gravity_m_s2, rel=0.02)


def test_free_walking_follows_a_leaning_person_gently() -> None:
    loop = Loop()
    loop.run(3.0, [0, 0, -30.0, 0, 0, 0])
    assert loop.pose[3] == pytest.approx(1.0 - 30.0 / ADMITTANCE.stiffness_hold_height_n_m, abs=2e-3)


def test_left_and_right_are_mirror_images() -> None:
    mirror = np.array([1.0, -1.0, -1.0, 1.0])
    wrenches = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    one, other = Loop(), Loop()
    for k in range(60):
        s = min(max(0.02 * (k - 20), 0.0), 1.0)
        wrench = np.array([40.0, 60.0 * np.sin(0.1 * k), -200.0, 2.0, 1.0, 5.0 * np.cos(0.2 * k)])
        a, b = one.step(wrench, s), other.step(wrench * wrenches, s)
        np.testing.assert_allclose(a.velocity, b.velocity * mirror, atol=3e-3)


def test_a_person_who_pushes_on_is_not_opposed_faster_than_the_limits_allow() -> None:
    """From 0.8 m/s into an arrest that comes out of nothing, still pushing: braked at the limits, no harder."""
    loop = Loop(mpc=SHIPPED)
    walking = loop.run(1.5, push(0, 30.0))
    opposed = loop.run(0.6, push(0, 60.0), 1.0, state=GaitState.ARREST)
    assert_within_limits(walking + opposed)
    braking = np.array([command.acceleration[0] for command in opposed])
    assert braking.min() < -0.9 * LIMITS.acceleration[0]  # it does brake
    first = np.diff([walking[-1].acceleration[0], *braking])
    assert first.min() >= -LIMITS.jerk[0] * PERIOD_S - 1e-9
    along = velocities(opposed)[:, 0]
    assert (np.diff(along) >= -LIMITS.acceleration[0] * PERIOD_S - 1e-9).all()


@pytest.mark.parametrize("seed", range(6))
def test_stiffening_foreseen_never_makes_the_present_softer(seed: int) -> None:
    """Two walkers with the same past and the same push; one of them foresees stiffening, at a random stage."""
    random = np.random.default_rng(seed)
    now = float(random.choice([0.0, 0.5 * random.random()]))
    later = np.clip(now + 0.2 * np.maximum(np.arange(20) - random.integers(1, 19), 0), 0.0, 1.0)
    wrench = np.zeros(6)
    wrench[list(WRENCH_AXES)] = random.uniform(-1, 1, 4) * [30, 30, 5, 150]
    commands = []
    for profile in (later, np.full(20, now)):
        loop = Loop(admittance=AdmittanceConfig(take_up_force_n=0.0), mpc=SHIPPED)
        loop.run(0.5, wrench, now)
        moving = np.sign(loop.velocity)
        commands.append(loop.step(wrench, profile))
    foreseen, flat = commands
    assert (foreseen.damping >= flat.damping - 1e-9).all()
    assert (foreseen.stiffness >= flat.stiffness - 1e-9).all()
    # what the person feels: it never gets away faster
    assert ((foreseen.acceleration - flat.acceleration) * moving <= 2e-3 * LIMITS.acceleration).all()


def test_the_drives_lag_does_not_slow_the_command() -> None:
    lagging, ideal = Loop(lag_s=0.05), Loop()
    a, b = velocities(lagging.run(0.6, push(0, 20.0))), velocities(ideal.run(0.6, push(0, 20.0)))
    np.testing.assert_allclose(a, b, atol=2e-3)


def test_a_blocked_base_does_not_wind_up() -> None:
    loop = Loop(lag_s=1e9)  # a wall
    commands = loop.run(1.2, push(0, 60.0))
    coupling = MPC.tracking_rate_per_s * ADMITTANCE.mass_horizontal_kg
    assert commands[-1].velocity[0] < MPC.tracking_tolerance_m_s + 60.0 / coupling + 0.02
    assert np.abs(velocities(commands)[-10:, 0] - commands[-1].velocity[0]).max() < 0.01


def test_stop_states_bring_base_and_column_to_rest() -> None:
    for state in (GaitState.SAFE_STOP, GaitState.DISARMED):
        loop = Loop()
        loop.run(1.0, push(0, 25.0))
        assert loop.velocity[0] > 0.3
        height = loop.pose[3]
        commands = loop.run(0.6, [25.0, 0, -500.0, 0, 0, 0], state=state)
        assert {command.solver for command in commands} == {"stop"}
        np.testing.assert_allclose(commands[-1].velocity, 0.0, atol=1e-4)
        assert loop.pose[3] == pytest.approx(height, abs=2e-3)
        assert np.diff(velocities(commands)[:, 0]).max() <= 1e-9  # never pushes on


def test_a_column_that_sags_in_a_stop_is_held_where_it_was_told_to_be() -> None:
    loop = Loop()
    loop.run(0.2, np.zeros(6))
    held = loop.step(state=GaitState.SAFE_STOP).column_height
    loop.pose[3] -= 0.05
    commands = loop.run(0.5, np.zeros(6), state=GaitState.SAFE_STOP)
    assert commands[-1].column_height == pytest.approx(held, abs=1e-4)


def test_the_command_carries_the_decision_and_what_is_rendered() -> None:
    loop = Loop()
    command = loop.step(np.zeros(6), 1.0, GaitState.ARREST)
    assert (command.state, command.solver, command.stamp_ns) == (GaitState.ARREST, "mpc", NS)
    assert command.stiffening == 1.0
    np.testing.assert_allclose(command.damping, ADMITTANCE.damping_arrest)
    assert command.reason == "as the test says"
    assert command.solve_time_s > 0
    assert command.rests_on_ns == NS
    command.check()


def test_a_hold_height_outside_the_stroke_is_refused() -> None:
    with pytest.raises(ConfigError, match="height_hold_m"):
        AdmittanceController(WALKER, AdmittanceConfig(height_hold_m=1.5), MPC)


def assert_within_limits(commands: list[SupportCommand], previous: np.ndarray | None = None) -> None:
    jacobian = Walker(WALKER).wheel_jacobian
    before = np.zeros(4) if previous is None else previous
    for command in commands:
        assert np.isfinite(command.velocity).all()
        assert np.isfinite(command.acceleration).all()
        assert (np.abs(command.velocity) <= LIMITS.velocity + 1e-9).all()
        assert (np.abs(command.acceleration) <= LIMITS.acceleration + 1e-9).all()
        assert (np.abs(command.acceleration - before) <= LIMITS.jerk * PERIOD_S + 1e-9).all()
        assert np.abs(jacobian @ command.velocity[:3]).max() <= WALKER.wheel_speed_max_rad_s + 1e-6
        assert WALKER.column_low_m - 1e-4 <= command.column_height <= WALKER.column_high_m + 1e-4
        before = command.acceleration


def with_nan(message: Any, field: str) -> Any:
    from dataclasses import replace

    value = getattr(message, field)
    return replace(message, **{field: np.full_like(value, np.nan) if isinstance(value, np.ndarray) else float("nan")})


@pytest.mark.parametrize("field", ["force", "torque"])
def test_a_wrench_that_is_not_a_number_gives_the_fallback_and_says_so(field: str) -> None:
    loop = Loop()
    before = loop.run(0.5, [20.0, 0, 0, 0, 0, 0])
    message = with_nan(Wrench(stamp_ns=loop.now_ns, force=np.zeros(3), torque=np.zeros(3)), field)
    command = loop.controller.step(loop.now_ns, loop.odometry(), message, decision())
    assert command.solver == "fallback"
    assert f"wrench {field} is not finite" in command.reason
    # What the last usable wrench foresaw: still pushed forward, not taken for let go.
    assert command.acceleration[0] == pytest.approx(before[-1].acceleration[0], abs=0.05)


@pytest.mark.parametrize("field", ["position", "yaw", "velocity", "yaw_rate"])
def test_odometry_that_is_not_a_number_gives_the_fallback_and_says_so(field: str) -> None:
    loop = Loop()
    loop.run(0.2, [20.0, 0, 0, 0, 0, 0])
    wrench = Wrench(stamp_ns=loop.now_ns, force=np.array([20.0, 0, 0]), torque=np.zeros(3))
    command = loop.controller.step(loop.now_ns, with_nan(loop.odometry(), field), wrench, decision())
    assert command.solver == "fallback"
    assert f"odometry {field} is not finite" in command.reason


@pytest.mark.parametrize(
    "profile", [np.full(20, np.nan), np.where(np.arange(20) == 9, np.nan, 0.5), np.full(20, 1.2), np.zeros(7)]
)
def test_a_profile_that_makes_no_sense_gives_the_fallback_and_says_so(profile: np.ndarray) -> None:
    loop = Loop()
    loop.run(0.2, [20.0, 0, 0, 0, 0, 0], 0.3)
    wrench = Wrench(stamp_ns=loop.now_ns, force=np.array([20.0, 0, 0]), torque=np.zeros(3))
    strange = decision()._replace(profile=profile)
    command = loop.controller.step(loop.now_ns, loop.odometry(), wrench, strange)
    assert command.solver == "fallback"
    assert "stiffening profile" in command.reason
    assert command.stiffening == pytest.approx(0.3)


def test_nothing_usable_from_the_start_stays_at_rest() -> None:
    loop = Loop()
    odometry = with_nan(loop.odometry(), "position")
    wrench = Wrench(stamp_ns=loop.now_ns, force=np.array([50.0, 0, 0]), torque=np.zeros(3))
    command = loop.controller.step(loop.now_ns, odometry, wrench, decision())
    assert command.solver == "stop"
    assert not command.valid
    np.testing.assert_allclose(command.velocity, 0.0)


class Broken:
    """A predictive law that fails while told to."""

    def __init__(self, inner: Any) -> None:
        self.inner, self.reason = inner, ""

    def plan(self, instant: Any) -> Any:
        return Failure(self.reason, "test") if self.reason else self.inner.plan(instant)

    @property
    def tip_limits(self) -> Any:
        return self.inner.tip_limits

    def reset(self) -> None:
        self.inner.reset()


def test_a_column_that_sags_while_there_is_no_plan_is_held_too() -> None:
    """A person hangs in the harness, the solver fails for good, the drive gives a little: nothing follows it down."""
    loop = Loop()
    broken = Broken(loop.controller._predictive)
    loop.controller._predictive = broken  # type: ignore[assignment]
    hanging = [0, 0, -700.0, 0, 0, 0]
    loop.run(0.5, hanging, 1.0, state=GaitState.ARREST)
    broken.reason = "the solver reached its iteration limit"
    commands = loop.run(0.5, hanging, 1.0, state=GaitState.ARREST)
    assert commands[-1].solver == "stop"
    held = commands[-1].column_height
    loop.pose[3] -= 0.01
    sagged = loop.run(4.0, hanging, 1.0, state=GaitState.ARREST)
    np.testing.assert_allclose([command.column_height for command in sagged], held, atol=1e-4)


@pytest.mark.parametrize("s", [0.0, 0.6])
def test_a_failing_solver_gives_the_fallback_then_a_stop_and_rejoins_without_a_jump(s: float) -> None:
    loop = Loop()
    broken = Broken(loop.controller._predictive)
    loop.controller._predictive = broken  # type: ignore[assignment]
    wrench = [25.0, 10.0, -100.0, 0, 0, 1.0]
    commands = loop.run(0.6, wrench, s)
    broken.reason = "the solver reached its iteration limit"
    failing = loop.run(0.5, wrench, s)
    solvers = [command.solver for command in failing]
    last = solvers.index("stop")
    assert solvers == ["fallback"] * last + ["stop"] * (len(solvers) - last)
    assert (last - 1) * PERIOD_S <= MPC.fallback_max_s + 1e-9
    assert "iteration limit" in failing[0].reason
    assert "no plan for" in failing[-1].reason
    assert np.abs(failing[-1].velocity).max() < 0.05
    # The law's own step and the plan's first one are the same law: no jump into the fallback either.
    np.testing.assert_allclose(failing[0].acceleration, commands[-1].acceleration, atol=0.05)
    broken.reason = ""
    again = loop.run(0.5, wrench, s)
    assert {command.solver for command in again} == {"mpc"}
    assert_within_limits(commands + failing + again)


def test_a_fault_of_the_solver_itself_is_survived() -> None:
    """One step with no iterations to spend, in the middle of a push, then as before."""
    loop = Loop()
    loop.run(0.2, [20.0, 0, 0, 0, 0, 0])
    solver = loop.controller._predictive._solver
    config = solver.config
    solver.config = config.model_copy(update={"max_iterations": 1})
    solver.forget()
    command = loop.step([150.0, 60.0, -300.0, 0, 0, 0], 1.0)
    assert command.solver == "fallback"
    assert "iteration limit" in command.reason
    solver.config = config
    assert loop.step([150.0, 60.0, -300.0, 0, 0, 0], 1.0).solver == "mpc"


def test_starting_in_motion_takes_over_the_measured_velocity() -> None:
    loop = Loop(velocity=(0.5, 0.1, 0.2, 0.0))
    command = loop.step()
    np.testing.assert_allclose(command.velocity, [0.5, 0.1, 0.2, 0.0], atol=0.02)


def test_late_and_repeated_calls_integrate_the_time_that_passed_within_bounds() -> None:
    loop = Loop()
    loop.run(0.3, [20.0, 0, 0, 0, 0, 0])
    same = loop.controller.step(loop.now_ns - int(PERIOD_S * NS), loop.odometry(), _still(loop), decision())
    assert (np.abs(same.velocity - loop.velocity) < 1e-9).all()
    loop.now_ns += NS  # a second of silence
    late = loop.controller.step(loop.now_ns, loop.odometry(), _still(loop), decision())
    assert np.abs(late.velocity - same.velocity).max() <= 2 * PERIOD_S * LIMITS.acceleration.max()


def _still(loop: Loop) -> Wrench:
    return Wrench(stamp_ns=loop.now_ns, force=np.zeros(3), torque=np.zeros(3))
