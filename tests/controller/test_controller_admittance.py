"""The admittance law by itself: stiffening, anchor, tank."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.admittance import AdmittanceConfig
from controller.admittance import Admittance, one_step

STAGES, STAGE_S, PERIOD_S = 20, 0.025, 0.01
CONFIG = AdmittanceConfig()


def admittance(config: AdmittanceConfig = CONFIG) -> Admittance:
    return Admittance(config, STAGE_S, np.ones(STAGES))


def pose(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, height: float = CONFIG.height_hold_m) -> np.ndarray:
    return np.array([x, y, yaw, height])


def flat(s: float) -> np.ndarray:
    return np.full(STAGES, s)


def test_free_walking_has_no_spring_and_light_damping() -> None:
    law = admittance().stages(flat(0.0), pose(3.0, -2.0, 1.0), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(law.damping, np.tile(CONFIG.damping_free, (STAGES, 1)))
    np.testing.assert_allclose(law.stiffness[:, :3], 0.0)
    np.testing.assert_allclose(law.load, 0.0, atol=1e-12)


def test_full_stiffening_has_the_arrest_values() -> None:
    law = admittance().stages(flat(1.0), pose(), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(law.damping[0], CONFIG.damping_arrest)
    expected = np.array(CONFIG.stiffness_arrest) + np.array([0, 0, 0, CONFIG.stiffness_hold_height_n_m])
    np.testing.assert_allclose(law.stiffness[0], expected)


@given(st.lists(st.floats(0, 1), min_size=2, max_size=2))
@settings(deadline=None, max_examples=30)
def test_more_stiffening_is_never_softer(pair: list[float]) -> None:
    low, high = sorted(pair)
    soft = admittance().stages(flat(low), pose(), np.zeros(4), np.zeros(4))
    stiff = admittance().stages(flat(high), pose(), np.zeros(4), np.zeros(4))
    assert (stiff.damping >= soft.damping - 1e-9).all()
    assert (stiff.stiffness >= soft.stiffness - 1e-9).all()


def test_anchor_is_placed_without_a_force() -> None:
    law = admittance(AdmittanceConfig(take_up_force_n=0.0))
    law.stages(flat(0.0), pose(2.0, 1.0, 0.3, 0.9), np.zeros(4), np.zeros(4))
    now = law.stages(flat(0.7), pose(2.1, 1.1, 0.4, 0.9), np.zeros(4), np.zeros(4))
    assert law.anchor is not None
    np.testing.assert_allclose(now.load[:, :3], 0.0, atol=1e-9)
    # The column's holding spring pulls as before, the arrest's does not yet.
    np.testing.assert_allclose(now.load[:, 3], CONFIG.stiffness_hold_height_n_m * (0.9 - CONFIG.height_hold_m))


def test_spring_pulls_back_along_the_base_axes() -> None:
    law = admittance()
    law.stages(flat(0.5), pose(), np.zeros(4), np.zeros(4))
    turned = law.stages(flat(0.5), pose(0.1, 0.0, np.pi / 2), np.zeros(4), np.zeros(4))
    stiffness = 0.25 * CONFIG.stiffness_arrest_horizontal_n_m
    # Facing left, what lies behind in the odometry frame's x is on the left... of where it was: -y of the base.
    np.testing.assert_allclose(turned.load[0, :2], [0.0, -0.1 * stiffness], atol=1e-9)
    assert turned.load[0, 2] > 0


def test_yaw_displacement_is_taken_the_short_way() -> None:
    law = admittance()
    law.stages(flat(0.5), pose(yaw=np.pi - 0.05), np.zeros(4), np.zeros(4))
    across = law.stages(flat(0.5), pose(yaw=-np.pi + 0.05), np.zeros(4), np.zeros(4))
    assert across.load[0, 2] == pytest.approx(0.25 * CONFIG.stiffness_arrest_yaw_nm_rad * 0.1)


def test_anchor_slips_with_a_person_who_walks_on() -> None:
    law = admittance()
    law.stages(flat(0.3), pose(), np.zeros(4), np.zeros(4))
    for k in range(300):
        now = law.stages(flat(0.3), pose(0.01 * k), np.zeros(4), np.zeros(4))
    pull = 0.09 * CONFIG.stiffness_arrest_horizontal_n_m * CONFIG.spring_reach_horizontal_m
    assert now.load[0, 0] == pytest.approx(pull)


def test_future_anchor_lies_where_the_free_walker_gets_to() -> None:
    velocity, force = np.array([0.6, -0.2, 0.4, 0.0]), np.array([30.0, 10.0, 2.0, -40.0])
    profile = np.where(np.arange(STAGES) >= 8, 0.9, 0.0)
    law = admittance()
    stages = law.stages(profile, pose(), velocity, force)
    v, p = velocity.copy(), np.zeros(4)
    for _ in range(8):
        a = one_step(law.mass, stages.damping[0], law.hold, force - law.hold * p, v, STAGE_S)
        p, v = p + STAGE_S * (v + 0.5 * STAGE_S * a), v + STAGE_S * a
    spring = (stages.stiffness - law.hold)[8:]
    np.testing.assert_allclose(stages.load[8:], -spring * p, atol=1e-9)
    np.testing.assert_allclose(stages.load[:8], 0.0, atol=1e-9)
    assert law.anchor is None


def test_empty_tank_holds_the_stiffness() -> None:
    law = admittance(AdmittanceConfig(tank_initial_j=0.0))
    law.stages(flat(0.2), pose(), np.zeros(4), np.zeros(4))
    before = law.stiffness.copy()
    law.stages(flat(1.0), pose(0.1), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(law.stiffness, before)
    law.stages(flat(1.0), pose(), np.zeros(4), np.zeros(4))  # back at the anchor it costs nothing
    np.testing.assert_allclose(law.stiffness, CONFIG.stiffness_arrest)


def test_one_step_is_exact_for_a_constant_force_on_average() -> None:
    """Average-acceleration steps of a spring: energy neither grows nor decays over many periods."""
    mass, stiffness = np.full(4, 3.0), np.full(4, 400.0)
    p, v = np.full(4, 0.1), np.zeros(4)
    start = 0.5 * mass * v**2 + 0.5 * stiffness * p**2
    for _ in range(2000):
        a = one_step(mass, np.zeros(4), stiffness, -stiffness * p, v, 0.05)
        p, v = p + 0.05 * (v + 0.025 * a), v + 0.05 * a
    np.testing.assert_allclose(0.5 * mass * v**2 + 0.5 * stiffness * p**2, start, rtol=1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 40.0))
@settings(deadline=None, max_examples=20)
def test_energy_delivered_never_exceeds_energy_taken_and_the_tank(seed: int, initial_j: float) -> None:
    """Passivity over random stiffening histories and pushes, with the law rendered exactly.

    Energy in the rendered mass and springs may at any time be at most what the person put in,
    what was there at the start, and what the tank held at the start.
    """
    random = np.random.default_rng(seed)
    law = admittance(AdmittanceConfig(tank_initial_j=initial_j))
    here, velocity = pose(), random.normal(0, 0.3, 4)
    hold = np.array([0, 0, 0, CONFIG.stiffness_hold_height_n_m])
    supplied = 0.5 * law.mass @ velocity**2
    profile, force = 0.0, np.zeros(4)
    for _ in range(250):
        if random.random() < 0.1:
            profile = random.choice([0.0, random.random(), 1.0])
        if random.random() < 0.1:
            force = random.normal(0, [80, 80, 10, 300])
        stages = law.stages(flat(profile), here, velocity, force)
        a = one_step(law.mass, stages.damping[0], stages.stiffness[0], force - stages.load[0], velocity, PERIOD_S)
        after = velocity + PERIOD_S * a
        moved = PERIOD_S * 0.5 * (velocity + after)
        heading = here[2] + 0.5 * moved[2]
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        law.settle(velocity, after, stages, force, PERIOD_S)
        supplied += float(force @ moved)
        here = here + np.concatenate([turn @ moved[:2], moved[2:]])
        velocity = after
        apart = law._displacement(here)
        stored = 0.5 * law.mass @ velocity**2 + 0.5 * law.stiffness @ apart**2
        stored += 0.5 * hold[3] * (here[3] - CONFIG.height_hold_m) ** 2
        # The turn within a step leaves a remainder of second order in the spring's frame.
        assert stored <= supplied + initial_j + 0.02 * (1.0 + abs(supplied))


def test_stiffening_at_a_displacement_is_paid_for_and_paid_back() -> None:
    law = admittance()
    law.stages(flat(0.3), pose(), np.zeros(4), np.zeros(4))  # the anchor is placed here
    before_j, slack = law.tank.energy_j, law.stiffness.copy()
    law.stages(flat(0.5), pose(x=0.05, y=-0.02), np.zeros(4), np.zeros(4))
    price_j = 0.5 * float((law.stiffness - slack) @ np.array([0.05, -0.02, 0.0, 0.0]) ** 2)
    assert price_j > 0.1
    assert law.tank.energy_j == pytest.approx(before_j - price_j)
    law.stages(flat(0.3), pose(x=0.05, y=-0.02), np.zeros(4), np.zeros(4))
    assert law.tank.energy_j == pytest.approx(before_j)


def test_the_tank_never_pays_more_than_it_holds() -> None:
    law = admittance(AdmittanceConfig(tank_initial_j=0.2))
    law.stages(flat(0.1), pose(), np.zeros(4), np.zeros(4))
    for _ in range(20):
        law.stages(flat(1.0), pose(x=0.1), np.zeros(4), np.zeros(4))
    spent_j = 0.5 * float((law.stiffness[0] - 0.01 * CONFIG.stiffness_arrest[0]) * 0.1**2)
    assert spent_j == pytest.approx(0.2)
    assert law.tank.energy_j == pytest.approx(0.0, abs=1e-9)
