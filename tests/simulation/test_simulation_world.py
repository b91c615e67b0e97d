"""Walker, harness and camera of the simulated world."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.walker import WalkerConfig
from controller.walker import Walker
from simulation.person.anthropometry import BodySize
from simulation.person.person import Intent
from simulation.world.camera import Detector, RobotCamera
from simulation.world.harness import FREE, harness_wrench
from simulation.world.parameters import HarnessParameters, WalkerParameters
from simulation.world.world import World, sensed

HARNESS = HarnessParameters()
REST = (0.0, 0.0, 0.0, 0.0)
OFFSETS = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.3), st.floats(-1, 1))
RATES = st.tuples(*[st.floats(-3, 3)] * 4)


def empty_walker(**changes: float) -> World:
    """A walker whose person stands beside the harness."""
    return World(BodySize(), walker=WalkerParameters(**changes), worn=False)


def drive(world: World, command: tuple[float, float, float, float], seconds: float) -> None:
    end = world.time_s + seconds
    while world.time_s < end:
        world.advance(command, Intent())


@given(OFFSETS, RATES)
def test_straps_only_pull(offset: tuple[float, ...], rate: tuple[float, ...]) -> None:
    wrench = harness_wrench(HARNESS, offset, rate)
    assert wrench.up_n <= 0.0
    along = wrench.forward_n * offset[0] + wrench.left_n * offset[1]
    assert along >= 0.0, "the harness pulls the walker after the person"
    assert wrench.yaw_nm * offset[3] >= 0.0


@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.019, 0.3), st.floats(-0.1, 0.1), RATES)
def test_nothing_is_felt_within_the_slack(x: float, y: float, up: float, yaw: float, rate: tuple[float, ...]) -> None:
    assert harness_wrench(HARNESS, (x, y, up, yaw), rate) == FREE


@given(OFFSETS, st.floats(1.01, 2.0))
def test_further_out_pulls_harder(offset: tuple[float, ...], more: float) -> None:
    near = harness_wrench(HARNESS, offset, REST)
    far = harness_wrench(HARNESS, tuple(more * each for each in offset), REST)
    assert np.hypot(far.forward_n, far.left_n) >= np.hypot(near.forward_n, near.left_n)
    assert far.up_n <= near.up_n


def test_wheels_turn_as_the_controller_believes() -> None:
    plant = empty_walker().walker
    believed = Walker(WalkerConfig()).wheel_jacobian
    np.testing.assert_allclose(plant._jacobian, believed, atol=1e-9)


def test_the_wheels_carry_the_whole_walker() -> None:
    world = empty_walker()
    drive(world, REST, 1.0)
    weight = (WalkerParameters().chassis_mass_kg + WalkerParameters().carriage_mass_kg) * 9.81
    assert world.walker.wheel_loads_n.sum() == pytest.approx(weight, rel=0.02)


def test_it_drives_as_it_is_told_in_every_direction() -> None:
    world = empty_walker()
    drive(world, (0.5, 0.2, 0.3, 0.05), 2.0)
    odometry = world.odometry()
    np.testing.assert_allclose(odometry.velocity, (0.5, 0.2, 0.05), atol=0.03)
    assert odometry.yaw_rate == pytest.approx(0.3, abs=0.03)
    assert odometry.tilt < 0.01


def test_smooth_rollers_cannot_brake_hard() -> None:
    ways = []
    for friction in (0.55, 0.02):
        world = empty_walker(friction=friction)
        drive(world, (0.8, 0.0, 0.0, 0.0), 6.0)
        before = world.odometry().position[0]
        speed = world.odometry().velocity[0]
        drive(world, REST, 1.0)
        ways.append((world.odometry().position[0] - before) / max(speed, 0.1) ** 2)
    assert ways[1] > 2.0 * ways[0]


def test_the_column_holds_a_hanging_person() -> None:
    world = World(BodySize(1.7, 100))
    while world.time_s < 4.0:
        world.advance(REST, Intent(effort=1.0 if world.time_s < 1.0 else 0.0))
    assert world.wrench.up_n < -500
    assert world.odometry().position[2] == pytest.approx(1.0, abs=0.02)
    assert world.pelvis_m[2] > world.person.pelvis_height_m - 0.10
    assert world.touched_down() == ""


def test_pulled_over_far_enough_it_tips() -> None:
    world = empty_walker()
    carriage = world.model.body("carriage").id
    while world.time_s < 1.5:
        world.disturbing.append((carriage, np.array([0.0, 900.0, 0.0, 0.0, 0.0, 0.0])))
        world.advance(REST, Intent())
    assert world.odometry().tilt > 0.2


def test_the_sensor_errs_by_its_offset_and_noise() -> None:
    rng, parameters = np.random.default_rng(0), WalkerParameters()
    bias = np.array([4.0, -3.0, 2.0])
    force = np.array([sensed(FREE, bias, rng.standard_normal, parameters)[0] for _ in range(2000)])
    np.testing.assert_allclose(force.mean(axis=0), bias, atol=0.2)
    np.testing.assert_allclose(force.std(axis=0), parameters.force_noise_n, rtol=0.1)


CAMERA = RobotCamera()
PERSON = np.column_stack((np.zeros(12), np.tile((0.15, -0.15), 6), np.repeat(np.linspace(1.4, 0.1, 6), 2)))


def test_the_camera_sees_left_on_the_right_when_it_looks_back_at_the_person() -> None:
    points, depth = CAMERA.project(PERSON, (0.0, 0.0, 0.0))
    assert np.all(points[0::2, 0] > points[1::2, 0])
    assert np.all(np.diff(points[0::2, 1]) > 0), "shoulders are above ankles"
    assert np.all(depth > 1.0)
    looked_at, _ = CAMERA.project(np.array([CAMERA.look_at_m]), (0.0, 0.0, 0.0))
    np.testing.assert_allclose(looked_at[0], (CAMERA.width_px / 2, CAMERA.height_px / 2), atol=1e-9)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
@settings(max_examples=30)
def test_the_camera_goes_where_the_walker_goes(x: float, y: float, yaw: float) -> None:
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    moved, _ = CAMERA.project(PERSON @ turn.T + (x, y, 0), (x, y, yaw))
    np.testing.assert_allclose(moved, CAMERA.project(PERSON, (0.0, 0.0, 0.0))[0], atol=1e-6)


def test_what_is_behind_the_camera_is_not_seen() -> None:
    points, depth = CAMERA.project(np.array([[3.0, 0.0, 1.0]]), (0.0, 0.0, 0.0))
    assert np.isnan(points).all()
    assert np.isnan(depth).all()


def test_a_detector_errs_as_two_of_them_differ_and_repeats_itself() -> None:
    exact, depth = CAMERA.project(PERSON, (0.0, 0.0, 0.0))
    trunk = np.linalg.norm(exact[:2].mean(axis=0) - exact[6:8].mean(axis=0))
    first, second = (Detector(CAMERA, np.random.default_rng(7)) for _ in range(2))
    frames = np.array([first.observe(exact, depth).points for _ in range(3000)])
    again = np.array([second.observe(exact, depth).points for _ in range(50)])
    np.testing.assert_array_equal(frames[:50], again)
    error = np.abs(frames[..., :2] - exact) / trunk
    typical = 1.4826 * np.nanmedian(error, axis=(0, 2))
    assert np.all((typical > 0.03) & (typical < 0.08))
    assert 0.01 < np.mean(error.max(axis=2) > 0.4) < 0.08
    assert 0.001 < np.isnan(frames[..., 0]).all(axis=1).mean() < 0.01
    assert np.all(frames[..., 2][np.isnan(frames[..., 0])] == 0.0)


def test_points_outside_the_picture_are_not_reported() -> None:
    close = RobotCamera(position_m=(0.5, 0.0, 1.2), look_at_m=(0.0, 0.0, 1.2), field_of_view_deg=50.0)
    exact, depth = close.project(PERSON, (0.0, 0.0, 0.0))
    seen = Detector(close, np.random.default_rng(1)).observe(exact, depth)
    outside = ~np.all((exact > -40) & (exact < (close.width_px + 40, close.height_px + 40)), axis=1)
    assert outside.any()
    assert np.isnan(seen.points[outside, :2]).all()
