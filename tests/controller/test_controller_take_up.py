"""The slack of the harness: taken up while stiffened, gently, no further than the straps bear, and paid for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from controller_loop import PERIOD_S, Loop

from bridge.config.admittance import AdmittanceConfig
from bridge.config.walker import WalkerConfig
from bridge.messages import GaitState
from controller.motion_limits import MotionLimits

CONFIG = AdmittanceConfig()
STRAP_N_M, SLACK_M = 40e3, 0.02


@dataclass
class Strap:
    """Somebody stands still in a harness that hangs from the column with some slack."""

    loop: Loop
    pelvis_m: float

    def load_n(self) -> float:
        return max(0.0, STRAP_N_M * (self.loop.pose[3] - SLACK_M - self.pelvis_m))

    def stand(self, span_s: float, s: float, leaning_n: float = 0.0) -> list[float]:
        heights = []
        for _ in range(round(span_s / PERIOD_S)):
            self.loop.step([0, 0, -self.load_n() - leaning_n, 0, 0, 0], s, GaitState.GUARD)
            heights.append(float(self.loop.pose[3]))
        return heights


def standing(config: AdmittanceConfig = CONFIG) -> Strap:
    loop = Loop(admittance=config, lag_s=0.03)
    loop.run(0.3, np.zeros(6))
    return Strap(loop, float(loop.pose[3]))


@pytest.mark.parametrize("s", [0.3, 0.6, 1.0])
def test_the_straps_bear_and_no_more(s: float) -> None:
    person = standing()
    before = float(person.loop.pose[3])
    heights = person.stand(1.5, s)
    wanted_n, millimetre_n = s * CONFIG.take_up_force_n, 1e-3 * STRAP_N_M
    assert 0.1 * wanted_n < person.load_n() <= wanted_n + millimetre_n
    assert heights[-1] - before == pytest.approx(SLACK_M, abs=0.004)


def test_it_is_quick_enough_for_a_fall_foreseen_300_ms_ahead() -> None:
    person = standing()
    person.stand(0.3, 1.0)
    assert person.load_n() > 0.0


def test_without_a_load_it_ends_at_its_reach() -> None:
    loop = Loop()
    loop.run(0.3, np.zeros(6))
    before = loop.pose[3]
    loop.run(2.0, np.zeros(6), 1.0)
    risen = loop.pose[3] - before
    assert 0.8 * CONFIG.take_up_reach_m < risen <= CONFIG.take_up_reach_m + 1e-3


def test_who_leans_harder_is_not_lifted() -> None:
    person = standing()
    before = person.loop.pose[3]
    person.stand(0.5, 1.0, leaning_n=1.1 * CONFIG.take_up_force_n)
    assert person.loop.pose[3] <= before + 1e-4


def test_what_was_taken_up_is_not_given_back_under_weight() -> None:
    """The anchor is a ratchet: 75 kg pull the column down from where it was lifted to, as far as the spring gives."""
    person = standing()
    person.stand(1.0, 1.0)
    lifted = person.loop.pose[3]
    weight = 75.0 * 9.81
    person.stand(1.5, 1.0, leaning_n=weight)
    total = CONFIG.stiffness_arrest_height_n_m + CONFIG.stiffness_hold_height_n_m
    assert lifted - person.loop.pose[3] < weight / total + 0.002


def test_relaxing_brings_the_column_back_slowly() -> None:
    person = standing()
    before = float(person.loop.pose[3])
    lifted = person.stand(1.0, 1.0)[-1]
    assert lifted > before + 0.01
    down = [lifted, *person.stand(3.0, 0.0)]
    assert down[-1] == pytest.approx(before, abs=2e-3)
    assert np.diff(down).min() > -0.15 * PERIOD_S


def test_it_keeps_to_the_limits_of_the_machine() -> None:
    loop = Loop()
    calm = loop.run(0.3, np.zeros(6))
    commands = [calm[-1], *loop.run(1.0, np.zeros(6), 1.0, state=GaitState.ARREST)]
    limits = MotionLimits(WalkerConfig())
    accelerations = np.array([command.acceleration for command in commands])
    assert (np.abs(accelerations) <= limits.acceleration + 1e-9).all()
    assert (np.abs(np.diff(accelerations, axis=0)) <= limits.jerk * PERIOD_S + 1e-9).all()
    assert max(command.velocity[3] for command in commands) <= CONFIG.take_up_speed_m_s + 0.01


def test_an_empty_tank_lifts_nobody() -> None:
    person = standing(AdmittanceConfig(tank_initial_j=0.0, tank_refill_fraction=0.0))
    before = float(person.loop.pose[3])
    assert max(person.stand(0.5, 1.0)) <= before + 1e-3


def test_zero_force_leaves_the_slack() -> None:
    person = standing(AdmittanceConfig(take_up_force_n=0.0))
    before = float(person.loop.pose[3])
    assert person.stand(0.5, 1.0)[-1] == pytest.approx(before, abs=1e-4)
