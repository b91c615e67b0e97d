"""The safety gate: what passes, what is bent, what is refused, and that it never jumps."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_gates import HANDED_THROUGH, HELD, LIMITS, PERIOD_NS, make_gate, run
from controller_messages import MS, NS, command

import controller.gate
from bridge.config.gate import GateConfig
from bridge.messages import GaitState, SupportCommand
from controller.gate import AXES, AxisLimits, GateLimits, SafetyGate


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
            rests_on_ns=NS - 20 * MS,
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
        assert out.damping.tolist() == list(HELD.damping)
        assert out.stiffness.tolist() == list(HELD.stiffness)
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
        gate.filter(None, NS)
        assert gate.refused == 2

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
        assert not make_gate().filter(command(NS + 50 * MS + 1), NS).valid

    def test_limits_are_said_in_milliseconds(self) -> None:
        gate = SafetyGate(replace(LIMITS, lifetime_s=0.9, future_tolerance_s=0.9), column_height_m=1.0)
        assert gate.filter(command(lifetime_s=0.9), NS + 901 * MS).reason.endswith("limit 900")
        assert gate.filter(command(NS + 901 * MS), NS).reason.endswith("limit 900")

    def test_same_command_may_be_given_until_it_expires(self) -> None:
        gate, asked = make_gate(), command(sequence=4)
        verdicts = [gate.filter(asked, NS + k * PERIOD_NS).valid for k in range(9)]
        assert verdicts == [True] * 7 + [False] * 2

    def test_a_command_rests_on_a_recent_frame(self) -> None:
        """A controller that goes on about a picture that stands still stamps its commands as ever."""
        assert make_gate().filter(command(2 * NS, rests_on_ns=2 * NS - 250 * MS), 2 * NS).valid
        out = make_gate().filter(command(2 * NS, rests_on_ns=2 * NS - 251 * MS), 2 * NS)
        assert (out.valid, out.reason) == (False, "command rests on a camera frame 251 ms old, limit 250")
        assert not make_gate().filter(command(2 * NS, rests_on_ns=2 * NS - 250 * MS - 1), 2 * NS).valid
        assert make_gate().filter(command(2 * NS, rests_on_ns=0), 2 * NS).valid, "a controller without a camera"
        stop = command(2 * NS, rests_on_ns=NS, valid=False, reason="because")
        assert make_gate().filter(stop, 2 * NS).reason == "because"


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
