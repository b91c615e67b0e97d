"""The safety gate when it must stop, hold and follow: ramps without a jump, and no way on that is not feasible."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from controller_gates import HELD, LIMITS, PERIOD_NS, make_gate, moving, run
from controller_messages import MS, NS, command

from bridge.messages import GaitState
from controller.gate import AxisLimits, SafetyGate, follow_velocity, stopping_speed


class TestStopping:
    def test_brakes_at_its_limits_and_not_beyond(self) -> None:
        gate, now_ns = moving()
        before = 0.8
        stopped_after_s = None
        for k in range(200):
            out = gate.filter(None, now_ns + k * PERIOD_NS)
            assert out.velocity[0] <= before + 1e-12
            before = float(out.velocity[0])
            if stopped_after_s is None and gate.at_rest:
                stopped_after_s = (k + 1) * 0.01
        # 0.8 m/s at 2 m/s^2 with 50 ms of winding the acceleration up and down
        assert stopped_after_s is not None
        assert 0.4 <= stopped_after_s <= 0.5
        assert out.velocity == pytest.approx(np.zeros(4), abs=1e-9)

    def test_column_comes_to_rest_and_is_held(self) -> None:
        gate, now_ns = moving(velocity=(0.0, 0.0, 0.0, 0.2), periods=30)
        heights = [gate.filter(None, now_ns + k * PERIOD_NS).column_height for k in range(100)]
        assert heights == sorted(heights)
        assert heights[-1] == heights[-20]
        assert heights[-1] - heights[0] < 0.02

    def test_column_held_within_its_stroke(self) -> None:
        gate = make_gate()
        run(gate, (0.0, 0.0, 0.0, 0.4), NS, 20)
        gate._height = 1.499
        heights = [gate.filter(None, NS + (20 + k) * PERIOD_NS).column_height for k in range(50)]
        assert max(heights) == 1.5

    def test_safe_command_of_the_controller_is_obeyed_with_its_reason(self) -> None:
        gate, now_ns = moving()
        asked = command(
            now_ns,
            sequence=10**6,
            valid=False,
            reason="wrench is 70 ms old",
            state=GaitState.DISARMED,
            stiffening=0.3,
            velocity=np.array([1.0, 1.0, 1.0, 0.0]),
            rests_on_ns=77,
            fall_distance=1.5,
            fall_probability=0.25,
        )
        refused = gate.refused
        out = gate.filter(asked, now_ns)
        assert (out.valid, out.solver, out.state) == (False, "stop", GaitState.DISARMED)
        assert (out.reason, out.stiffening, out.sequence) == ("wrench is 70 ms old", 0.3, 10**6)
        assert (out.rests_on_ns, out.fall_distance, out.fall_probability) == (77, 1.5, 0.25)
        assert abs(out.velocity[0]) < 0.8
        assert gate.refused == refused
        assert out.stamp_ns == now_ns
        assert (tuple(out.damping), tuple(out.stiffness)) == HELD

    def test_gate_that_was_not_told_what_a_stop_holds_with_says_nothing(self) -> None:
        out = SafetyGate(LIMITS, column_height_m=1.0).filter(None, NS)
        assert not out.damping.any()
        assert not out.stiffness.any()

    def test_safe_command_need_not_know_where_the_column_is(self) -> None:
        out = make_gate().filter(command(valid=False, column_height=0.0, reason="braking"), NS)
        assert (out.reason, out.column_height) == ("braking", 1.0)

    def test_late_safe_command_is_still_late(self) -> None:
        out = make_gate().filter(command(valid=False, reason="braking"), NS + 61 * MS)
        assert out.reason == "command expired: 61 ms old, limit 60"

    def test_time_in_which_nobody_called_was_spent_braking(self) -> None:
        """A frozen process that wakes up goes on from rest, not from the velocity it went to sleep with."""
        gate, now_ns = moving()
        wake_ns = now_ns + NS
        out = gate.filter(command(wake_ns, velocity=np.array([0.8, -0.5, 1.0, 0.0]), sequence=10**6), wake_ns)
        assert out.valid
        assert abs(out.velocity[0]) <= 0.1 + 1e-12  # at most 50 ms of acceleration

    def test_a_short_sleep_is_braked_for_as_long_as_it_lasted(self) -> None:
        """120 ms: two steps of 50 ms at -2 m/s^2, then 20 ms in which the command is back and -2 winds down to -1.2."""
        gate = make_gate()
        run(gate, (0.8, 0.0, 0.0, 0.0), NS, 100)
        wake_ns = NS + 99 * PERIOD_NS + 120 * MS
        out = gate.filter(command(wake_ns, velocity=np.array([0.8, 0, 0, 0]), sequence=10**6), wake_ns)
        assert out.velocity[0] == pytest.approx(0.8 - 0.1 - 0.1 - 1.2 * 0.02)

    def test_column_that_was_moving_when_the_process_froze_went_on_until_it_stopped(self) -> None:
        gate, now_ns = moving(velocity=(0.0, 0.0, 0.0, 0.4), periods=30)
        before = gate.filter(None, now_ns).column_height
        after = gate.filter(None, now_ns + NS).column_height
        # from at most 0.4 m/s at 4 m/s^2 with 25 ms of winding up
        assert before + 0.01 < after < before + 0.04

    def test_step_of_exactly_the_longest_length_is_one_step(self) -> None:
        slow, fast = make_gate(), make_gate()
        for gate, gap in ((slow, 50 * MS), (fast, 50 * MS + 1)):
            run(gate, (0.5, 0.0, 0.0, 0.0), NS, 100)
            at_ns = NS + 99 * PERIOD_NS + gap
            out = gate.filter(command(at_ns, velocity=np.array([0.5, 0, 0, 0]), sequence=10**6), at_ns)
            gate.last = out  # type: ignore[attr-defined]
        assert slow.last.velocity[0] == pytest.approx(0.5)  # type: ignore[attr-defined]
        assert fast.last.velocity[0] < 0.45  # type: ignore[attr-defined]

    def test_clock_that_runs_backwards_stands_still(self) -> None:
        gate, now_ns = moving()
        first = gate.filter(None, now_ns)
        second = gate.filter(None, now_ns - 500 * MS)
        assert (second.velocity == first.velocity).all()
        third = gate.filter(None, now_ns + PERIOD_NS)
        assert 0 < first.velocity[0] - third.velocity[0] <= 2.0 * 0.01 + 1e-12

    def test_two_calls_at_one_moment_do_not_move_twice(self) -> None:
        gate, now_ns = moving()
        first = gate.filter(None, now_ns)
        second = gate.filter(None, now_ns)
        assert (second.velocity == first.velocity).all()
        assert (second.acceleration == first.acceleration).all()

    def test_at_rest(self) -> None:
        gate = make_gate()
        assert gate.at_rest
        run(gate, (0.0, -0.5, 0.0, 0.0), NS, 20)
        assert not gate.at_rest


class TestHolding:
    def test_measured_height_is_held_until_the_first_command(self) -> None:
        gate = make_gate()
        gate.hold(0.8)
        assert gate.filter(None, NS).column_height == 0.8
        gate.filter(command(NS, column_height=0.8, sequence=1), NS)
        gate.hold(1.2)
        assert gate.filter(None, NS).column_height == 0.8

    @pytest.mark.parametrize(("measured", "held"), [(0.1, 0.5), (2.0, 1.5), (math.nan, 1.0), (math.inf, 1.0)])
    def test_nonsense_is_not_held(self, measured: float, held: float) -> None:
        gate = make_gate()
        gate.hold(measured)
        assert gate.filter(None, NS).column_height == held

    def test_starts_within_the_stroke(self) -> None:
        assert make_gate(column_height_m=9.0).filter(None, NS).column_height == 1.5
        assert make_gate(column_height_m=0.0).filter(None, NS).column_height == 0.5

    def test_height_follows_at_the_speed_of_the_column(self) -> None:
        up = run(make_gate(), np.zeros(4), NS, 3, column_height=1.3)
        assert [o.column_height for o in up] == pytest.approx([1.0, 1.004, 1.008])
        down = run(make_gate(), np.zeros(4), NS, 3, column_height=0.7)
        assert [o.column_height for o in down] == pytest.approx([1.0, 0.996, 0.992])

    @pytest.mark.parametrize(("height", "velocity"), [(1.4, 0.4), (0.6, -0.4)])
    def test_column_keeps_its_speed_where_there_is_room(self, height: float, velocity: float) -> None:
        gate = make_gate(column_height_m=height)
        assert run(gate, (0, 0, 0, velocity), NS, 30, column_height=height)[-1].velocity[3] == pytest.approx(velocity)

    @pytest.mark.parametrize("direction", [-1.0, 1.0])
    def test_column_slows_before_the_end_of_its_stroke(self, direction: float) -> None:
        gate, height, v = make_gate(), 1.0, 0.0
        for k in range(400):
            now_ns = NS + k * PERIOD_NS
            asked = command(
                now_ns,
                velocity=np.array([0, 0, 0, direction * 0.4]),
                column_height=min(max(height + v * 0.01, 0.5), 1.5),
                sequence=k,
            )
            v = float(gate.filter(asked, now_ns).velocity[3])
            height += v * 0.01
            assert 0.5 - 1e-3 <= height <= 1.5 + 1e-3
        assert height == pytest.approx(1.0 + direction * 0.5, abs=5e-3)
        assert v == pytest.approx(0.0, abs=1e-3)


class TestFollowing:
    LIMITS = AxisLimits(1.0, 2.0, 40.0)

    def settle(
        self, v: float, a: float, target: float, steps: int = 200, dt: float = 0.01
    ) -> list[tuple[float, float]]:
        out, before = [], target
        for _ in range(steps):
            v, a = follow_velocity(v, a, target, (target - before) / dt, dt, self.LIMITS)
            out.append((v, a))
        return out

    @pytest.mark.parametrize("target", [1.0, 0.3, -0.7, -1.0, 0.0])
    @pytest.mark.parametrize("v", [-1.0, -0.2, 0.0, 0.9])
    def test_reaches_the_target_without_overshoot(self, v: float, target: float) -> None:
        path = [x for x, _ in self.settle(v, 0.0, target)]
        low, high = min(v, target), max(v, target)
        assert all(low - 1e-9 <= x <= high + 1e-9 for x in path)
        assert path[-1] == pytest.approx(target, abs=1e-9)

    def test_takes_no_longer_than_it_must(self) -> None:
        """0 -> 1 m/s: 0.05 s up to 2 m/s^2, 0.45 s at it, 0.05 s down."""
        path = [x for x, _ in self.settle(0.0, 0.0, 1.0)]
        steps = next(k for k, x in enumerate(path) if x > 1.0 - 1e-4)
        assert 0.50 <= steps * 0.01 <= 0.60

    def test_winds_down_at_the_jerk_limit_exactly(self) -> None:
        """The rate chosen, wound down at J, closes exactly the gap: x dt + x^2 / (2 J) = 0.05 m/s."""
        _, x = follow_velocity(0.0, 1.6, 0.05, 0.0, 0.01, self.LIMITS)
        assert x * 0.01 + x * x / (2 * 40.0) == pytest.approx(0.05)

    def test_mirror(self) -> None:
        right = self.settle(0.3, 0.1, 0.9)
        left = self.settle(-0.3, -0.1, -0.9)
        assert -np.array(left) == pytest.approx(np.array(right))

    def test_winds_acceleration_down_before_the_velocity_limit(self) -> None:
        """At full acceleration 0.05 m/s under the limit the velocity can just be turned round in time."""
        v, a = 0.95, 2.0
        for _ in range(6):
            v, a = follow_velocity(v, a, 1.0, 0.0, 0.01, self.LIMITS)
            assert v <= 1.0
        assert a == pytest.approx(0.0, abs=0.3)

    @pytest.mark.parametrize("slope", [-50.0, 50.0])
    def test_slope_beyond_the_acceleration_limit_is_not_believed(self, slope: float) -> None:
        _, a = follow_velocity(0.0, math.copysign(2.0, slope), 0.0, slope, 0.01, self.LIMITS)
        assert abs(a) <= 2.0

    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_a_command_that_rises_into_the_velocity_limit_can_still_be_turned_round(self, sign: float) -> None:
        """Whatever slope is believed: winding the acceleration down at J always ends within V."""
        v, a = sign * 0.9, sign * 2.0
        for _ in range(8):
            v, a = follow_velocity(v, a, sign * 1.0, sign * 2.0, 0.01, self.LIMITS)
            assert abs(v) + a * a / (2 * 40.0) <= 1.0 + 1e-9

    def test_stopping_speed_stops_within_the_room(self) -> None:
        A, J = 2.0, 160.0
        for room in (0.0, 1e-3, 0.05, 0.4):
            v = stopping_speed(room, A, J)
            assert v * v / (2 * A) + v * A / (2 * J) == pytest.approx(room, abs=1e-12)
        assert stopping_speed(-0.1, A, J) == 0.0


def test_output_is_a_fresh_message_each_time() -> None:
    """Nothing downstream can change what the gate remembers."""
    gate = make_gate()
    first = run(gate, (0.5, 0, 0, 0), NS, 5)[-1]
    kept = first.velocity.copy()
    run(gate, (0.5, 0, 0, 0), NS + 5 * PERIOD_NS, 5)
    assert (first.velocity == kept).all()
    assert not first.velocity.flags.writeable


def test_drive_side_bends_what_the_controller_side_let_pass() -> None:
    """Two gates with different limits: the second holds its own."""
    tight = SafetyGate(replace(LIMITS, speed_m_s=0.92), column_height_m=1.0)
    wide = make_gate()
    for k in range(200):
        now_ns = NS + k * PERIOD_NS
        passed = wide.filter(command(now_ns, velocity=np.array([1.0, 0, 0, 0]), sequence=k), now_ns)
        out = tight.filter(passed, now_ns)
        assert abs(out.velocity[0]) <= 0.92
    assert out.velocity[0] == pytest.approx(0.92)
