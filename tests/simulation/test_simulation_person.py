"""The simulated person: a body with the tables' masses that walks and falls by its own joints alone."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.errors import ConfigError
from simulation.person import anthropometry as tables
from simulation.person.ability import FRAIL, STURDY
from simulation.person.anthropometry import BodySize
from simulation.person.body import LEG_JOINTS, SIDES, add_person
from simulation.person.leg import leg_angles
from simulation.person.person import Intent
from simulation.person.stepping import bob, dip, foothold, plan_step
from simulation.person.support import Sole, double_support, ground_force
from simulation.scenarios.disturbance import Faint, Push
from simulation.scenarios.scenario import Performance, Scenario, Wish
from simulation.world.world import World

SIZES = st.builds(BodySize, st.floats(1.5, 1.95), st.floats(45, 120))


def vertical_force(world: World, side: str) -> float:
    """Vertical force under one sole [N]."""
    data, sole = world.data, world.person.sole[side]
    total, wrench = 0.0, np.zeros(6)
    for index in range(data.ncon):
        if sole in (data.contact[index].geom1, data.contact[index].geom2):
            mujoco.mj_contactForce(world.model, data, index, wrench)
            total += wrench[0]
    return total


def model_of(size: BodySize) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_person(spec, size)
    return spec.compile()


def walk(speed: float, seconds: float, size: BodySize, turn: float = 0.0) -> World:
    """Walk without walker or harness."""
    world = World(size, FRAIL, worn=False)
    while world.time_s < seconds:
        world.advance((0.0, 0.0, 0.0, 0.0), Intent(speed, turn) if world.time_s > 1.0 else Intent())
        assert not world.person.fallen, f"fell after {world.time_s:.1f} s"
    return world


@given(SIZES)
@settings(deadline=None, max_examples=8)
def test_the_body_weighs_what_the_person_weighs(size: BodySize) -> None:
    model = model_of(size)
    assert model.body_mass.sum() == pytest.approx(size.mass_kg, rel=2e-3)
    assert np.all(model.body_inertia[1:] > 0)
    principal = np.sort(model.body_inertia[1:], axis=1)
    assert np.all(principal[:, 2] <= principal[:, :2].sum(axis=1) * (1 + 1e-9)), "no such rigid body exists"


def test_segments_add_up_to_one_body() -> None:
    paired = (tables.UPPER_ARM, tables.FOREARM, tables.THIGH, tables.SHANK, tables.FOOT)
    whole = sum(part.mass for part in (tables.TRUNK, tables.PELVIS, tables.HEAD)) + 2 * sum(p.mass for p in paired)
    assert whole == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(("height", "mass"), [(1.4, 70), (2.0, 70), (1.7, 44), (1.7, 121), (float("nan"), 70)])
def test_a_size_the_tables_do_not_cover_is_refused(height: float, mass: float) -> None:
    with pytest.raises(ConfigError, match=r"must lie within \["):
        BodySize(height, mass)


@given(
    st.floats(-0.35, 0.35), st.floats(-0.12, 0.2), st.floats(0.72, 0.97), st.floats(-0.4, 0.4), st.floats(-0.3, 0.3),
    st.sampled_from(SIDES),
)  # fmt: skip
@settings(deadline=None, max_examples=60)
def test_leg_angles_put_the_foot_where_it_was_wanted(
    forward: float, outward: float, share: float, yaw: float, pitch: float, which: tuple[str, float]
) -> None:
    side, sign = which
    size = BodySize(1.7, 75)
    model = model_of(size)
    data = mujoco.MjData(model)
    hip = np.array([0.0, sign * size.hip_half_width_m, 0.0])
    reach = np.array([forward, sign * outward, 0.0])
    down = math.sqrt(max((share * size.leg_m) ** 2 - reach @ reach, 0.0))
    ankle = hip + reach - [0.0, 0.0, down]
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    rotation = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    angles = leg_angles(ankle, rotation, hip, size.thigh_m, size.shank_m)
    for name, angle in zip(LEG_JOINTS, angles, strict=True):
        data.qpos[model.joint(f"{side}_{name}").qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    pelvis, foot = model.body("pelvis").id, model.body(f"{side}_foot").id
    np.testing.assert_allclose(data.xpos[foot] - data.xpos[pelvis], ankle, atol=1e-9)
    np.testing.assert_allclose(data.xmat[foot].reshape(3, 3), rotation, atol=1e-9)


@given(st.floats(0.0, 1.2), st.floats(1.5, 1.95), st.sampled_from([1.0, -1.0]))
def test_steady_steps_repeat_themselves(speed: float, height: float, side: float) -> None:
    """The DCM that starts a step at its offset from one foot ends it at the mirrored offset from the next."""
    step, omega = plan_step(speed, height, 0.2, FRAIL), 3.3
    forward, left = step.offset(omega, -side)  # at the touchdown of a foot of the other side's step
    growth = math.exp(omega * step.duration_s)
    next_forward, next_left = forward * growth - step.length_m, left * growth + side * step.width_m
    assert next_forward == pytest.approx(step.offset(omega, side)[0], abs=1e-9)
    assert next_left == pytest.approx(step.offset(omega, side)[1], abs=1e-9)


@given(st.floats(0.0, 0.03), st.floats(0.0, 1.0), st.floats(0.4, 1.1))
def test_the_body_rises_and_sinks_as_its_rates_say(deep: float, at_s: float, step_s: float) -> None:
    small = 1e-5
    before, now, after = (bob(deep, at_s + d, step_s) for d in (-small, 0.0, small))
    assert 0.0 <= now.low_m <= deep + 1e-12
    assert (after.low_m - before.low_m) / (2 * small) == pytest.approx(now.sinking_m_s, abs=1e-6)
    assert (before.sinking_m_s - after.sinking_m_s) / (2 * small) == pytest.approx(now.upward_m_s2, abs=1e-4)


@given(st.floats(0.0, 0.5), st.floats(0.0, 0.1))
def test_longer_steps_are_walked_lower(ahead: float, more: float) -> None:
    assert 0.0 <= dip(ahead, 0.83, 0.985, 0.985) <= dip(ahead + more, 0.83, 0.985, 0.985)


@given(st.floats(-3, 3), st.floats(-3, 3), st.sampled_from([1.0, -1.0]))
def test_footholds_are_within_reach_and_feet_do_not_cross(x: float, y: float, side: float) -> None:
    forward, left = foothold((x, y), side, 1.7, FRAIL)
    assert -FRAIL.step_back * 1.7 <= forward <= FRAIL.step_forward * 1.7
    assert FRAIL.step_narrow * 1.7 - 1e-12 <= -side * left <= FRAIL.step_wide * 1.7 + 1e-12


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(-math.pi, math.pi))
def test_two_feet_share_the_load_and_press_inside_their_soles(x: float, y: float, least: float, turn: float) -> None:
    heading = (math.cos(turn), math.sin(turn))
    lead, trail = Sole(0.3, 0.1, 0.11, 0.04), Sole(0.0, -0.1, 0.11, 0.04)
    stance = double_support(lead, trail, (x, y), heading, least)
    assert sum(stance.share) == pytest.approx(1.0)
    assert min(stance.share) >= -1e-12
    for sole, point in zip((lead, trail), stance.pressure, strict=True):
        dx, dy = point[0] - sole.x, point[1] - sole.y
        assert abs(heading[0] * dx + heading[1] * dy) <= sole.half_length + 1e-9
        assert abs(heading[0] * dy - heading[1] * dx) <= sole.half_width + 1e-9


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-80, 80), st.floats(-80, 80))
def test_the_ground_pushes_up_and_within_friction(x: float, y: float, mx: float, my: float) -> None:
    force = ground_force(np.array([0.0, 0.0, 0.9]), 0.9, (x, y), 700.0, (mx, my))
    assert force[2] == 700.0
    assert math.hypot(force[0], force[1]) <= 0.7 * 700.0 + 1e-9


def test_who_stands_stays_where_they_are() -> None:
    world = World(BodySize(1.6, 60), FRAIL, worn=False)
    start = world.pelvis_m.copy()
    while world.time_s < 5.0:
        world.advance((0.0, 0.0, 0.0, 0.0), Intent())
    assert np.linalg.norm(world.pelvis_m - start) < 0.08
    assert world.person.steps == 0


def test_walking_holds_for_a_minute_at_the_speed_wanted() -> None:
    world = walk(0.6, 60.0, BodySize(1.7, 75))
    assert world.pelvis_m[0] / 59.0 == pytest.approx(0.6, abs=0.06)
    assert world.person.steps > 50


@pytest.mark.parametrize(("speed", "height", "mass"), [(0.3, 1.5, 45), (1.2, 1.7, 75), (0.8, 1.95, 120)])
def test_tall_and_small_walk_slowly_and_fast(speed: float, height: float, mass: float) -> None:
    world = walk(speed, 12.0, BodySize(height, mass))
    assert world.pelvis_m[0] > 0.7 * min(speed, 0.95) * 11
    assert world.pelvis_m[0] < 1.2 * speed * 11


def test_feet_land_softly() -> None:
    """The vertical force of a foot, over 20 ms, stays near what healthy walkers show: 1 to 1.3 weights."""
    size = BodySize(1.7, 75)
    world = walk(0.6, 5.0, size)
    force = []
    while world.time_s < 9.0:
        world.advance((0.0, 0.0, 0.0, 0.0), Intent(0.6))
        force.append(vertical_force(world, "l") / (size.mass_kg * 9.81))
    assert 1.0 < np.convolve(force, np.ones(5) / 5.0, "valid").max() < 1.8


def test_nothing_but_the_floor_carries_a_walking_person() -> None:
    world = World(BodySize(1.7, 75), FRAIL, worn=False)
    person_dofs = world.model.joint("walker").dofadr[0]
    for _ in range(1000):
        world.advance((0.0, 0.0, 0.0, 0.0), Intent(0.5))
        assert not world.data.xfrc_applied[: world.walker.body].any()
        assert not world.data.qfrc_applied[:person_dofs].any()
        assert not world.data.qfrc_actuator[:6].any()
    assert world.pelvis_m[0] > 0.5


def trial(disturbance: Push | Faint, seconds: float = 12.0) -> tuple[Performance, float | None]:
    """Return the performance and when a knee, the pelvis or the trunk came down, after the disturbance."""
    wishes = (Wish(1.0, Intent(0.6)),)
    scenario = Scenario("x", "fall", "x", BodySize(), wishes, STURDY, disturbances=(disturbance,))
    performance = Performance(scenario, worn=False)
    while performance.world.time_s < seconds:
        performance.advance((0.0, 0.0, 0.0, 0.0))
        if performance.world.touched_down():
            return performance, performance.world.time_s - disturbance.at_s
    return performance, None


def test_a_small_push_is_survived_by_stepping() -> None:
    performance, down_s = trial(Push(6.0, 20.0, 90.0))
    assert down_s is None
    assert not performance.world.person.fallen


@pytest.mark.parametrize("disturbance", [Push(6.0, 100.0, 90.0), Push(6.0, 100.0, 180.0), Faint(6.0)])
def test_what_exceeds_balance_ends_on_the_floor_in_its_own_time(disturbance: Push | Faint) -> None:
    _, down_s = trial(disturbance)
    assert down_s is not None
    assert 0.3 < down_s < 3.0


@pytest.mark.parametrize("direction", [90.0, -90.0])
def test_pushed_sideways_the_person_steps_in_time(direction: float) -> None:
    """0.4 m/s sideways, what young people survive with a detour of about 0.4 m."""
    performance, down_s = trial(Push(5.0, 0.4 * BodySize().mass_kg, direction), seconds=9.0)
    assert down_s is None
    assert not performance.world.person.fallen


def test_a_faint_leaves_no_strength() -> None:
    performance, _ = trial(Faint(6.0), seconds=6.6)
    assert np.abs(performance.world.data.ctrl[: performance.world.model.nu]).max() <= 5.0
