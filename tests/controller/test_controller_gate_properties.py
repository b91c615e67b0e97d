"""Whatever is thrown at the gate, in whatever rhythm: the output stays inside every limit and rate."""

from __future__ import annotations

from typing import Any

import numpy as np
from controller_messages import MS, NS, command
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config.gate import GateConfig
from controller.gate import COLUMN, GateLimits, SafetyGate

LIMITS = GateLimits(**GateConfig().model_dump())

number = st.one_of(
    st.floats(-1.3, 1.3),
    st.sampled_from([0.0, 1.2, -1.2, 1e9, float("nan"), float("inf"), -float("inf")]),
)
turn = st.fixed_dictionaries(
    {
        "kind": st.sampled_from(["command", "command", "command", "same", "nothing", "stop"]),
        "velocity": st.lists(number, min_size=4, max_size=4),
        "column_height": st.one_of(st.floats(0.6, 1.3), st.just(float("nan"))),
        "age_ms": st.sampled_from([0, 0, 0, 5, 20, 59, 61, 500, -20, -90]),
        "sequence_step": st.sampled_from([1, 1, 1, 1, 0, -3, 100]),
        "gap_us": st.sampled_from([10_000, 10_000, 10_000, 1_000, 0, 37_000, 50_000]),
    }
)


@settings(max_examples=100, deadline=None)
@given(turns=st.lists(turn, min_size=2, max_size=60))
def test_output_inside_every_limit_and_rate(turns: list[dict[str, Any]]) -> None:
    gate = SafetyGate(LIMITS, column_height_m=1.0)
    now_ns, sequence, asked = NS, 0, None
    velocity, acceleration, height = np.zeros(4), np.zeros(4), 1.0
    top, A, J = (np.array(column) for column in zip(*LIMITS.axes(), strict=True))
    for k, given_turn in enumerate(turns):
        gap_ns = given_turn["gap_us"] * 1000 if k else 0
        now_ns += gap_ns
        sequence += given_turn["sequence_step"]
        if given_turn["kind"] == "nothing":
            asked = None
        elif given_turn["kind"] != "same":
            asked = command(
                now_ns - given_turn["age_ms"] * MS,
                velocity=np.array(given_turn["velocity"]),
                column_height=given_turn["column_height"],
                sequence=max(sequence, 0),
                valid=given_turn["kind"] == "command",
            )
        out = gate.filter(asked, now_ns)
        out.check()
        dt = gap_ns / NS
        assert (np.abs(out.velocity) <= top).all()
        assert (np.abs(out.velocity - velocity) <= A * dt + 1e-12).all()
        assert (np.abs(out.acceleration) <= A + 1e-12).all()
        assert (np.abs(out.acceleration - acceleration) <= J * dt + 1e-9).all()
        assert LIMITS.column_low_m <= out.column_height <= LIMITS.column_high_m
        assert abs(out.column_height - height) <= top[COLUMN] * dt + 1e-12
        assert out.valid or out.reason or asked is not None
        velocity, acceleration, height = out.velocity, out.acceleration, out.column_height


@settings(max_examples=25, deadline=None)
@given(
    lost_for=st.integers(1, 80),
    velocity=st.lists(st.floats(-0.4, 0.4), min_size=4, max_size=4),
)
def test_no_jump_at_loss_or_return(lost_for: int, velocity: list[float]) -> None:
    """Commands stop coming and come back: braking and rejoining stay inside the acceleration limit, and both arrive."""
    gate = SafetyGate(LIMITS, column_height_m=1.0)
    wanted = np.array(velocity)
    wanted[COLUMN] = 0.0
    out, before = None, np.zeros(4)
    acceleration_max = np.array([limit.acceleration for limit in LIMITS.axes()])
    for k in range(140 + lost_for):
        now_ns = NS + k * 10 * MS
        lost = 60 <= k < 60 + lost_for
        asked = None if lost else command(now_ns, velocity=wanted, sequence=k)
        out = gate.filter(asked, now_ns)
        assert (np.abs(out.velocity - before) <= acceleration_max * 0.01 + 1e-12).all()
        before = out.velocity
    assert out is not None
    np.testing.assert_allclose(out.velocity, wanted, atol=1e-9)
