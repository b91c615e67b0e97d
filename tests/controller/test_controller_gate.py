"""The safety gate: what passes, what is bent, what is refused, and that it never jumps."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_messages import MS, NS, command

import controller.gate
from bridge.config.gate import GateConfig
from bridge.messages import GaitState, SupportCommand
from controller.gate import AXES, AxisLimits, GateLimits, SafetyGate, follow_velocity, stopping_speed

LIMITS = GateLimits(
    speed_m_s=1.0,
    acceleration_m_s2=2.0,
    jerk_m_s3=40.0,
    yaw_rate_rad_s=1.5,
    yaw_acceleration_rad_s2=4.0,
    yaw_jerk_rad_s3=80.0,
    column_speed_m_s=0.4,
    column_acceleration_m_s2=4.0,
    column_jerk_m_s3=160.0,
    column_low_m=0.5,
    column_high_m=1.5,
    lifetime_s=0.06,
    future_tolerance_s=0.05,
    excess_fraction=0.1,
)
PERIOD_NS = 10 * MS
HANDED_THROUGH = (
    *("stiffening", "state", "solver", "lifetime_s", "sequence", "reason", "valid", "frame_id"),
    *("rests_on_ns", "fall_distance", "fall_probability", "solve_time_s"),
)


def make_gate(**changes: Any) -> SafetyGate:
    options: dict[str, Any] = {"column_height_m": 1.0, "ordered": True} | changes
    return SafetyGate(LIMITS, **options)


def run(gate: SafetyGate, velocity: Any, start_ns: int, periods: int, **changes: Any) -> list[SupportCommand]:
    """Give the gate the same wish `periods` times, each with its own stamp and number."""
    out = []
    for k in range(periods):
        now_ns = start_ns + k * PERIOD_NS
        asked = command(now_ns, velocity=np.array(velocity, dtype=float), sequence=now_ns // PERIOD_NS, **changes)
        out.append(gate.filter(asked, now_ns))
    return out


def moving(periods: int = 100, velocity: Any = (0.8, -0.5, 1.0, 0.0), **options: Any) -> tuple[SafetyGate, int]:
    """Return a gate in full motion and the time of its next call."""
    gate = make_gate(**options)
    run(gate, velocity, NS, periods)
    return gate, NS + periods * PERIOD_NS


class TestIndependence:
    def test_imports_numpy_and_the_messages_alone(self) -> None:
        tree = ast.parse(Path(controller.gate.__file__).read_text())
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        modules |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        standard = {"__future__", "collections.abc", "dataclasses", "math", "typing"}
        assert modules - standard == {"numpy", "bridge.messages", "bridge.errors"}

    def test_configuration_has_exactly_the_limits(self) -> None:
        limits = GateLimits(**GateConfig().model_dump())
        assert limits.speed_m_s == GateConfig().speed_m_s

    def test_each_axis_has_its_own_limits(self) -> None:
        base, left, yaw, column = LIMITS.axes()
        assert base == left == AxisLimits(1.0, 2.0, 40.0)
        assert yaw == AxisLimits(1.5, 4.0, 80.0)
        assert column == AxisLimits(0.4, 4.0, 160.0)


class TestPassing:
    def test_command_within_limits_passes_unchanged(self) -> None:
        """A trajectory that respects acceleration and jerk comes out as it went in, number for number."""
        gate = make_gate()
        for k in range(300):
            now_ns = NS + k * PERIOD_NS
            ramp = min(k / 100, 1.0)
            velocity = ramp * np.array([0.4, 0.3, 0.5, 0.1]) * math.sin(0.02 * k)
            asked = command(now_ns, velocity=velocity, sequence=k, column_height=1.0 + 0.01 * math.sin(0.05 * k))
            out = gate.filter(asked, now_ns)
            assert out.velocity == pytest.approx(velocity, abs=1e-12)
            assert out.column_height == asked.column_height
        assert (gate.passed, gate.refused) == (300, 0)

    def test_what_is_not_motion_is_handed_through(self) -> None:
        asked = command(
            NS - 5 * MS,
            stiffening=0.7,
            damping=np.arange(4.0),
            stiffness=np.arange(4.0) + 5,
            state=GaitState.GUARD,
            solver="fallback",
            lifetime_s=0.03,
            sequence=17,
            reason="near the boundary",
            rests_on_ns=123,
            fall_distance=0.4,
            fall_probability=0.6,
            solve_time_s=0.001,
            frame_id="walker",
        )
        out = make_gate().filter(asked, NS)
        for name in HANDED_THROUGH:
            assert getattr(out, name) == getattr(asked, name), name
        assert (out.damping == asked.damping).all()
        assert (out.stiffness == asked.stiffness).all()
        assert out.stamp_ns == NS

    def test_unknown_fall_distance_passes(self) -> None:
        out = make_gate().filter(command(fall_distance=math.nan, fall_probability=math.nan), NS)
        assert out.valid
        assert math.isnan(out.fall_distance)

    def test_acceleration_is_the_one_executed(self) -> None:
        out = run(make_gate(), (1.0, 0.0, 0.0, 0.0), NS, 3, acceleration=np.full(4, 99.0))
        assert [o.acceleration[0] for o in out] == pytest.approx([0.0, 0.4, 0.8])
        assert out[2].velocity[0] == pytest.approx(0.012)

    def test_life_is_bounded(self) -> None:
        assert make_gate().filter(command(lifetime_s=1.0), NS).lifetime_s == LIMITS.lifetime_s


class TestRefusing:
    """Refused means: braking ramp, column held, and the reason said."""

    @pytest.mark.parametrize(
        ("changes", "reason"),
        [
            ({"velocity": np.array([np.nan, 0, 0, 0])}, "command velocity is not finite"),
            ({"velocity": np.array([0, 0, np.inf, 0])}, "command velocity is not finite"),
            ({"acceleration": np.array([0, 0, 0, np.nan])}, "command acceleration is not finite"),
            ({"column_height": math.nan}, "command column_height is not finite"),
            ({"damping": np.array([0, np.nan, 0, 0])}, "command damping or stiffness is not finite"),
            ({"stiffness": np.array([0, np.inf, 0, 0])}, "command damping or stiffness is not finite"),
            ({"stiffening": 1.01}, "command stiffening is 1.01, limits 0..1"),
            ({"stiffening": math.nan}, "command stiffening is nan, limits 0..1"),
            ({"lifetime_s": -0.01}, "command lifetime_s is -0.01, limits 0..1"),
            ({"velocity": np.array([1.2, 0, 0, 0])}, "command forward velocity [m/s] is 1.2, limit 1"),
            ({"velocity": np.array([0, -1.2, 0, 0])}, "command left velocity [m/s] is -1.2, limit 1"),
            ({"velocity": np.array([0, 0, 1.8, 0])}, "command yaw rate [rad/s] is 1.8, limit 1.5"),
            ({"velocity": np.array([0, 0, 0, -0.5])}, "command column velocity [m/s] is -0.5, limit 0.4"),
            ({"column_height": 1.61}, "command column_height is 1.61, limits 0.5..1.5 m"),
            ({"column_height": 0.39}, "command column_height is 0.39, limits 0.5..1.5 m"),
        ],
    )
    def test_nonsense(self, changes: dict[str, Any], reason: str) -> None:
        gate = make_gate()
        out = gate.filter(command(**changes), NS)
        assert out.reason == reason
        self.is_safe_stop(out)
        assert (gate.passed, gate.refused) == (0, 1)

    def is_safe_stop(self, out: SupportCommand) -> None:
        assert (out.valid, out.state, out.solver) == (False, GaitState.SAFE_STOP, "stop")
        assert out.stiffening == 1.0
        assert out.lifetime_s == LIMITS.lifetime_s
        assert not out.damping.any()
        assert not out.stiffness.any()
        assert (out.sequence, out.rests_on_ns) == (0, 0)
        assert math.isnan(out.fall_distance)
        assert math.isnan(out.fall_probability)
        out.check()

    def test_no_command(self) -> None:
        gate = make_gate()
        out = gate.filter(None, NS)
        self.is_safe_stop(out)
        assert out.reason == "no command received yet"
        assert out.stamp_ns == NS
        assert gate.refused == 1

    @pytest.mark.parametrize("axis", range(4))
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_small_excess_is_clipped_at_the_exact_bound(self, axis: int, sign: float) -> None:
        limit = LIMITS.axes()[axis].velocity
        at_bound = np.zeros(4)
        at_bound[axis] = sign * limit * 1.1
        gate = make_gate()
        out = gate.filter(command(velocity=at_bound), NS)
        assert out.valid, out.reason
        beyond = np.zeros(4)
        beyond[axis] = sign * np.nextafter(limit * 1.1, np.inf)
        refused = gate.filter(command(NS + 1, velocity=beyond, sequence=1), NS + 1)
        assert not refused.valid
        assert refused.reason.startswith(f"command {AXES[axis]} is")

    def test_small_excess_is_executed_at_the_limit(self) -> None:
        out = run(make_gate(), (1.1, -1.1, 1.6, 0.0), NS, 200)[-1]
        assert out.velocity == pytest.approx([1.0, -1.0, 1.5, 0.0])

    @pytest.mark.parametrize(("height", "held"), [(0.4, 0.5), (1.6, 1.5)])
    def test_column_just_beyond_its_stroke_is_clipped(self, height: float, held: float) -> None:
        out = run(make_gate(), np.zeros(4), NS, 300, column_height=height)[-1]
        assert out.valid
        assert out.column_height == held


class TestTime:
    def test_lifetime_boundary_is_exact(self) -> None:
        """At stamp + lifetime a command is still executed, one nanosecond later it is not."""
        asked = command(lifetime_s=0.03)
        assert make_gate().filter(asked, NS + 30 * MS).valid
        out = make_gate().filter(asked, NS + 30 * MS + 1)
        assert not out.valid
        assert out.reason == "command expired: 30 ms old, limit 30"

    def test_gate_shortens_a_long_life(self) -> None:
        asked = command(lifetime_s=1.0)
        assert make_gate().filter(asked, NS + 60 * MS).valid
        out = make_gate().filter(asked, NS + 60 * MS + 1)
        assert out.reason == "command expired: 60 ms old, limit 60"

    def test_future_boundary_is_exact(self) -> None:
        assert make_gate().filter(command(NS + 50 * MS), NS).valid
        out = make_gate().filter(command(NS + 51 * MS), NS)
        assert out.reason == "command is stamped 51 ms ahead, limit 50"
        assert not make_gate().filter(command(NS + 50 * MS + 1000), NS).valid

    def test_same_command_may_be_given_until_it_expires(self) -> None:
        gate, asked = make_gate(), command(sequence=4)
        verdicts = [gate.filter(asked, NS + k * PERIOD_NS).valid for k in range(9)]
        assert verdicts == [True] * 7 + [False] * 2


class TestOrder:
    def test_numbers_count_unless_told_otherwise(self) -> None:
        gate = SafetyGate(LIMITS, column_height_m=1.0)
        gate.filter(command(NS, sequence=7), NS)
        assert not gate.filter(command(NS + MS, sequence=6), NS + MS).valid

    def test_older_number_is_refused(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=7), NS)
        out = gate.filter(command(NS + MS, sequence=6), NS + MS)
        assert out.reason == "command 6 came after 7"

    def test_same_number_with_another_stamp_is_refused(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=7), NS)
        out = gate.filter(command(NS + MS, sequence=7), NS + MS)
        assert out.reason == "command 7 came after 7"

    def test_older_stamp_is_refused_whatever_its_number(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=7), NS)
        out = gate.filter(command(NS - 3 * MS, sequence=8), NS + MS)
        assert out.reason == "command is 3 ms older than the one before"

    def test_same_stamp_with_a_newer_number_passes(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=7), NS)
        assert gate.filter(command(NS, sequence=8), NS + MS).valid

    def test_refused_command_does_not_count_as_seen(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=9, column_height=math.nan), NS)
        assert gate.filter(command(NS, sequence=1), NS).valid

    def test_restarted_controller_is_taken_once_its_last_command_has_expired(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=1000), NS)
        last_moment = NS + 60 * MS
        assert not gate.filter(command(last_moment, sequence=0), last_moment).valid
        assert gate.filter(command(last_moment + 1, sequence=0), last_moment + 1).valid
        assert gate.filter(command(last_moment + MS, sequence=1), last_moment + MS).valid

    def test_replayed_recording_is_refused_after_expiry_too(self) -> None:
        """What an eavesdropper kept has old stamps: fresh or not, it never comes in again."""
        gate = make_gate()
        kept = [command(NS + k * PERIOD_NS, sequence=k, lifetime_s=0.06) for k in range(5)]
        for k, asked in enumerate(kept):
            gate.filter(asked, NS + k * PERIOD_NS)
        late = NS + 5 * PERIOD_NS
        assert not any(gate.filter(asked, late).valid for asked in kept[:-1])

    def test_restart_needs_a_newer_stamp(self) -> None:
        gate = make_gate()
        gate.filter(command(NS, sequence=5, lifetime_s=0.0), NS)
        out = gate.filter(command(NS, sequence=3, lifetime_s=0.06), NS + MS)
        assert out.reason == "command 3 came after 5"

    def test_unnumbered_stream_is_judged_by_stamps_alone(self) -> None:
        gate = make_gate(ordered=False)
        assert all(gate.filter(command(NS + k * PERIOD_NS), NS + k * PERIOD_NS).valid for k in range(5))
        assert not gate.filter(command(NS), NS + 5 * PERIOD_NS).valid

    def test_number_zero_is_a_number(self) -> None:
        assert make_gate().filter(command(sequence=0), NS).valid

    def test_stamp_zero_is_a_stamp(self) -> None:
        assert make_gate().filter(command(0), 0).valid


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
