"""The drive's motion and its scripted person: exact where there is a formula, plausible where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.drive import DriveConfig
from simulation.drive.motion import DriveModel, DriveState
from simulation.drive.script import scripted_force

MODEL = DriveModel(base_lag_s=0.05, column_lag_s=0.03, column_low_m=0.7, column_high_m=1.2)
STIFF = DriveModel(base_lag_s=0.0, column_lag_s=0.0, column_low_m=0.7, column_high_m=1.2)


def drive(model: DriveModel, commanded: tuple[float, float, float, float], span_s: float, steps: int) -> DriveState:
    state = DriveState()
    for _ in range(steps):
        state = model.advance(state, commanded, span_s / steps)
    return state


class TestMotion:
    def test_first_order_step_response(self) -> None:
        state = drive(MODEL, (1.0, 0.0, 0.0, 0.0), 0.1, 10)
        assert state.forward == pytest.approx(1.0 - math.exp(-2.0))
        assert state.x == pytest.approx(0.1 - 0.05 * (1.0 - math.exp(-2.0)))

    def test_straight_motion_does_not_depend_on_the_step(self) -> None:
        coarse, fine = (drive(MODEL, (0.4, -0.2, 0.0, 0.1), 1.0, n) for n in (7, 500))
        assert np.array(coarse) == pytest.approx(np.array(fine))

    def test_turning_drives_a_circle(self) -> None:
        """Half a metre a second at one radian a second: radius 0.5 m, back at the start after a turn."""
        state = drive(STIFF, (0.5, 0.0, 1.0, 0.0), 2.0 * math.pi, 2000)
        assert (state.x, state.y) == pytest.approx((0.0, 0.0), abs=1e-9)
        quarter = drive(STIFF, (0.5, 0.0, 1.0, 0.0), 0.5 * math.pi, 2000)
        assert (quarter.x, quarter.y, quarter.yaw) == pytest.approx((0.5, 0.5, 0.5 * math.pi), abs=1e-6)

    def test_left_is_left(self) -> None:
        state = drive(STIFF, (0.0, 0.3, 0.0, 0.0), 1.0, 10)
        assert (state.x, state.y) == pytest.approx((0.0, 0.3))

    def test_mirror(self) -> None:
        right = drive(MODEL, (0.5, -0.2, -0.7, 0.0), 2.0, 100)
        left = drive(MODEL, (0.5, 0.2, 0.7, 0.0), 2.0, 100)
        assert (left.x, left.y, left.yaw) == pytest.approx((right.x, -right.y, -right.yaw))

    @pytest.mark.parametrize(("speed", "end"), [(0.4, 1.2), (-0.4, 0.7)])
    def test_column_stands_at_its_end_stop(self, speed: float, end: float) -> None:
        state = drive(MODEL, (0.0, 0.0, 0.0, speed), 3.0, 300)
        assert state.height == end
        assert state.column == 0.0

    def test_column_leaves_its_end_stop(self) -> None:
        state = MODEL.advance(DriveState(height=1.2), (0.0, 0.0, 0.0, -0.2), 0.1)
        assert state.height < 1.2
        assert state.column < 0.0

    @settings(max_examples=60, deadline=None)
    @given(st.lists(st.tuples(*[st.floats(-2, 2)] * 4), max_size=50), st.floats(0.0, 0.1))
    def test_never_faster_than_it_was_told(self, commands: list[tuple[float, float, float, float]], dt: float) -> None:
        state, top = DriveState(), np.zeros(4)
        for commanded in commands:
            state = MODEL.advance(state, commanded, dt)
            top = np.maximum(top, np.abs(commanded))
            assert (np.abs([state.forward, state.left, state.yaw_rate, state.column]) <= top + 1e-12).all()
            assert 0.7 <= state.height <= 1.2


class TestScript:
    @pytest.mark.parametrize("script", ["zero", "walk", "push", "fall"])
    def test_starts_from_nothing_and_stays_possible(self, script: str) -> None:
        config = DriveConfig.model_validate({"script": script})
        forces = np.array([scripted_force(config, t) for t in np.arange(0, 20, 0.01)])
        assert not forces[0].any()
        assert np.isfinite(forces).all()
        assert np.abs(forces).max() <= config.fall_load_n

    def test_zero(self) -> None:
        config = DriveConfig(script="zero")
        assert not any(scripted_force(config, t).any() for t in np.arange(0, 20, 0.1))

    def test_walking_pushes_forward_leans_and_sways_with_the_step(self) -> None:
        config = DriveConfig(script="walk", cadence_hz=2.0)
        forces = np.array([scripted_force(config, t) for t in np.arange(1.0, 11.0, 0.01)])
        assert forces.mean(axis=0) == pytest.approx([config.walk_force_n, 0.0, -config.walk_lean_n], abs=0.1)
        power = np.abs(np.fft.rfft(forces - forces.mean(axis=0), axis=0))
        assert power[:, 0].argmax() == 20  # 2 Hz over 10 s
        assert power[:, 1].argmax() == 10  # every second step
        assert power[:, 2].argmax() == 20

    def test_push_is_walking_with_a_push(self) -> None:
        walk, push = DriveConfig(script="walk"), DriveConfig(script="push", event_s=3.0, push_s=0.2, push_force_n=80.0)
        for t, extra in ((2.99, 0.0), (3.0, 80.0), (3.19, 80.0), (3.2, 0.0)):
            difference = scripted_force(push, t) - scripted_force(walk, t)
            assert difference == pytest.approx([0.0, extra, 0.0])

    def test_fall_hangs_in_the_harness_and_stands_up_again(self) -> None:
        config = DriveConfig(script="fall", event_s=3.0, fall_rise_s=0.3, fall_hold_s=2.0)
        walk = DriveConfig(script="walk")
        assert scripted_force(config, 3.0) == pytest.approx(scripted_force(walk, 3.0))
        assert scripted_force(config, 3.3) == pytest.approx([0.0, 0.0, -600.0], rel=0.021)
        assert scripted_force(config, 5.3) == pytest.approx([0.0, 0.0, -600.0], rel=0.021)
        assert -600.0 < scripted_force(config, 5.8)[2] < -100.0
        assert scripted_force(config, 6.3) == pytest.approx(scripted_force(walk, 6.3))

    def test_load_builds_up_without_a_jump(self) -> None:
        config = DriveConfig(script="fall", event_s=3.0)
        down = np.array([scripted_force(config, t)[2] for t in np.arange(2.5, 8.0, 0.001)])
        assert np.abs(np.diff(down)).max() < 5.0
