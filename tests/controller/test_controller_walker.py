"""The walker's model against textbook and first principles."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from bridge.config.walker import WalkerConfig
from controller.machine_limits import ROWS, MachineLimits, moments_at_rest, moments_by_acceleration
from controller.walker import WHEELS, Walker, urdf

CONFIG = WalkerConfig(chassis_com_forward_m=0.07)
NOW = np.ones(1)


@pytest.fixture(scope="module")
def walker() -> Walker:
    return Walker(CONFIG)


def test_the_file_holds_the_default_numbers() -> None:
    from importlib import resources

    shipped = ElementTree.fromstring(resources.files("controller").joinpath("walker.urdf").read_text("utf-8"))
    written = ElementTree.fromstring(urdf(WalkerConfig()))
    for a, b in zip(shipped.iter(), written.iter(), strict=True):
        assert a.tag == b.tag
        for key, value in a.attrib.items():
            try:
                numbers = [float(part) for part in value.split()]
            except ValueError:
                assert value == b.attrib[key]
            else:
                np.testing.assert_allclose([float(part) for part in b.attrib[key].split()], numbers, rtol=1e-3)


def test_wheel_jacobian_is_the_textbook_one(walker: Walker) -> None:
    arm = 0.5 * (CONFIG.wheelbase_m + CONFIG.track_m)
    textbook = np.array([[1, -1, -arm], [1, 1, arm], [1, 1, -arm], [1, -1, arm]]) / CONFIG.wheel_radius_m
    np.testing.assert_allclose(walker.wheel_jacobian, textbook, atol=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_wheel_jacobian_by_finite_differences(walker: Walker, axis: int) -> None:
    """Move the base a little; each wheel must turn by what its centre moved along its roller's grip."""
    delta = 1e-6
    move = np.zeros(3)
    move[axis] = delta
    for row, wheel in enumerate(WHEELS):
        _, end, side = wheel.split("_")
        x = CONFIG.wheelbase_m / 2 * (1 if end == "front" else -1)
        y = CONFIG.track_m / 2 * (1 if side == "left" else -1)
        turn = np.array([[np.cos(move[2]), -np.sin(move[2])], [np.sin(move[2]), np.cos(move[2])]])
        shift = move[:2] + turn @ [x, y] - [x, y]
        roller = np.array([1.0, -np.sign(x * y)]) / np.sqrt(2)
        turned = roller @ shift / (CONFIG.wheel_radius_m * roller[0])
        assert turned / delta == pytest.approx(walker.wheel_jacobian[row, axis], abs=1e-4)


def test_mass_matrix_is_symmetric_positive_definite_and_says_the_mass(walker: Walker) -> None:
    for height in (0.7, 0.95, 1.2):
        mass = walker.evaluate(height, np.array([0.4, -0.2, 0.5, 0.1])).mass
        np.testing.assert_allclose(mass, mass.T, atol=1e-9)
        assert np.linalg.eigvalsh(mass).min() > 0
        floor = mass - walker.reflected
        np.testing.assert_allclose([floor[0, 0], floor[1, 1]], CONFIG.mass_kg, rtol=1e-9)
        assert floor[3, 3] == pytest.approx(CONFIG.carriage_mass_kg)
        assert np.linalg.eigvalsh(walker.reflected).min() > -1e-9


def test_reflected_inertia_is_that_of_four_spinning_wheels(walker: Walker) -> None:
    spin = 0.5 * CONFIG.wheel_mass_kg * CONFIG.wheel_radius_m**2
    spin += CONFIG.wheel_rotor_inertia_kg_m2 * CONFIG.wheel_gear_ratio**2
    expected = 4 * spin / CONFIG.wheel_radius_m**2
    assert walker.reflected[0, 0] == pytest.approx(expected)
    assert walker.reflected[1, 1] == pytest.approx(expected)


def test_free_model_conserves_energy(walker: Walker) -> None:
    """M a + n = 0, integrated: kinetic plus potential energy stays."""

    def slope(state: np.ndarray) -> np.ndarray:
        terms = walker.evaluate(float(state[0]), state[1:])
        return np.concatenate([[state[4]], -np.linalg.solve(terms.mass, terms.bias)])

    def energy(state: np.ndarray) -> float:
        terms = walker.evaluate(float(state[0]), state[1:])
        return float(
            0.5 * state[1:] @ terms.mass @ state[1:] + CONFIG.carriage_mass_kg * CONFIG.gravity_m_s2 * state[0]
        )

    state = np.array([1.0, 0.8, -0.4, 1.1, 0.6])
    start, dt = energy(state), 1e-3
    for _ in range(400):
        k1 = slope(state)
        k2 = slope(state + dt / 2 * k1)
        k3 = slope(state + dt / 2 * k2)
        k4 = slope(state + dt * k3)
        state = state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert energy(state) == pytest.approx(start, rel=1e-9)
    assert abs(state[1] - 0.8) > 0.05  # the turning base's offset mass did move the rest


def test_gravity_loads_the_column_and_a_hanging_person_adds_to_it(walker: Walker) -> None:
    terms = walker.evaluate(1.0, np.zeros(4))
    assert terms.column_gravity == pytest.approx(CONFIG.carriage_mass_kg * CONFIG.gravity_m_s2)
    hanging = np.array([0, 0, -600.0, 0, 0, 0]) @ terms.interface
    np.testing.assert_allclose(hanging, [0, 0, 0, -600.0], atol=1e-9)
    acceleration = np.linalg.solve(terms.mass, hanging + np.array([0, 0, 0, terms.column_gravity]) - terms.bias)
    assert acceleration[3] < 0


def test_interface_wrench_pushes_the_way_it_points(walker: Walker) -> None:
    terms = walker.evaluate(1.0, np.zeros(4))
    force = np.array([30.0, -20.0, 0, 0, 0, 5.0]) @ terms.interface
    np.testing.assert_allclose(force, [30.0, -20.0, 5.0, 0.0], atol=1e-9)
    assert terms.interface_position[2] == pytest.approx(1.0)


def test_zero_moment_point_at_rest_is_below_the_centre_of_mass(walker: Walker) -> None:
    terms = walker.evaluate(1.0, np.zeros(4))
    bias, _ = moments_at_rest(terms, walker.weight, np.zeros(6))
    assert bias[2] == pytest.approx(CONFIG.mass_kg * CONFIG.gravity_m_s2)
    np.testing.assert_allclose(bias[:2] / bias[2], terms.centre_of_mass[:2], atol=1e-9)


def test_zero_moment_point_by_point_masses(walker: Walker) -> None:
    """Against sums over chassis, wheels and carriage as point masses with a wrench on top."""
    terms = walker.evaluate(1.1, np.zeros(4))
    a, w = np.array([1.3, -0.7, 0.0, 0.9]), np.array([40.0, -25.0, -300.0, 3.0, -4.0, 1.0])
    g, r = CONFIG.gravity_m_s2, CONFIG.wheel_radius_m
    bodies = [(CONFIG.chassis_mass_kg, CONFIG.chassis_com_forward_m, CONFIG.chassis_com_height_m, 0.0)]
    bodies += [(4 * CONFIG.wheel_mass_kg, 0.0, r, 0.0)]
    bodies += [(CONFIG.carriage_mass_kg, 0.0, 1.1 - CONFIG.carriage_com_below_m, a[3])]
    load = sum(m * (g + up) for m, _, _, up in bodies) - w[2]
    spin = 4 * 0.5 * CONFIG.wheel_mass_kg * r**2 / r
    mx = sum(m * (g + up) * x - m * a[0] * z for m, x, z, up in bodies) + w[0] * 1.1 + w[4] - spin * a[0]
    my = sum(-m * a[1] * z for m, _, z, _ in bodies) + w[1] * 1.1 - w[3]
    got = moments_by_acceleration(terms) @ a + sum(moments_at_rest(terms, walker.weight, w))
    np.testing.assert_allclose(got[2], load)
    np.testing.assert_allclose(got[0], mx, atol=1e-6)
    np.testing.assert_allclose(got[1], my, atol=1e-6)


def test_limits_are_satisfied_at_rest_and_mirror_symmetric() -> None:
    walker = Walker(WalkerConfig())
    machine = MachineLimits(walker)
    terms = walker.evaluate(1.0, np.zeros(4))
    assert machine.rows.shape == (ROWS, 4)
    mirror = np.array([1.0, -1.0, -1.0, 1.0])
    wrench = np.array([50.0, 80.0, -400.0, 6.0, -3.0, 9.0])
    mirrored = wrench * [1, -1, 1, -1, 1, -1]
    rest = machine.bounds(terms, np.zeros(6), NOW)
    assert (rest.low < 0).all()
    assert (rest.high > 0).all()
    wheels = [1, 0, 3, 2]
    one, other = machine.bounds(terms, wrench, NOW), machine.bounds(terms, mirrored, NOW)
    np.testing.assert_allclose(one.high[0, :4], other.high[0, wheels], atol=1e-9)
    np.testing.assert_allclose(one.high[0, 8:10], other.high[0, 8:10], atol=1e-9)
    np.testing.assert_allclose(one.high[0, [10, 11]], other.high[0, [11, 10]], atol=1e-9)
    np.testing.assert_allclose(machine.rows[:4] @ np.diag(mirror), machine.rows[wheels], atol=1e-9)


def test_giving_way_keeps_drives_and_balance_where_that_is_possible() -> None:
    walker = Walker(WalkerConfig())
    machine = MachineLimits(walker)
    terms = walker.evaluate(1.0, np.zeros(4))
    calm = machine.bounds(terms, np.zeros(6), NOW)
    np.testing.assert_allclose(machine.give_way(terms, np.zeros(6), calm), 0.0)
    push = np.array([0.0, 300.0, -100.0, 0, 0, 0])
    bounds = machine.bounds(terms, push, NOW)
    assert not (bounds.high[0] >= 0).all()  # standing still would tip the walker
    way = machine.give_way(terms, push, bounds)
    assert way[1] > 0  # so it moves under the push
    value = machine.rows @ way
    assert (value <= bounds.high[0] + 1e-9).all()
    assert (value >= bounds.low[0] - 1e-9).all()


def test_an_overwhelming_push_is_given_way_to_in_its_direction() -> None:
    walker = Walker(WalkerConfig(acceleration_forward_max_m_s2=15.0, wheel_torque_max_nm=5.0))
    machine = MachineLimits(walker)
    terms = walker.evaluate(1.0, np.zeros(4))
    push = np.array([-600.0, 0, 0, 0, 560.0, 0])  # its torque keeps it from tipping
    bounds = machine.bounds(terms, push, NOW)
    way = machine.give_way(terms, push, bounds)
    assert way[0] < 0
    value = machine.rows[:4] @ way
    assert (value >= bounds.low[0, :4] - 1e-9).all()
    assert (value <= bounds.high[0, :4] + 1e-9).all()
