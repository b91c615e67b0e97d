"""The judge of the fault suite sees jumps, late stops and braking, and nothing where nothing is."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults import results
from benchmarks.faults.judge import (
    Outcome,
    Timed,
    braking_since,
    first_follow,
    first_stop,
    largest_jump,
    largest_motion_jump,
)
from benchmarks.faults.stream_faults import FAULTS, Carried, StreamFault
from benchmarks.fuzz.corpus import corpus
from bridge.codec import decode
from bridge.config.gate import GateConfig
from bridge.errors import InvalidMessage
from bridge.messages import GaitState, Odometry, SupportCommand
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from controller.gate import GateLimits, SafetyGate

NS = 1_000_000_000
PERIOD_NS = 10_000_000
LIMITS = GateLimits(**GateConfig().model_dump())
STREAMS = (KEYPOINTS, FALL_HORIZON, WRENCH, ODOMETRY, SUPPORT_COMMAND)


def command(stamp_ns: int, velocity: float = 0.5, state: GaitState = GaitState.FOLLOW, **changes) -> SupportCommand:
    fields = {
        "stamp_ns": stamp_ns,
        "velocity": np.array([velocity, 0.0, 0.0, 0.0]),
        "acceleration": np.zeros(4),
        "column_height": 1.0,
        "stiffening": 0.0,
        "damping": np.zeros(4),
        "stiffness": np.zeros(4),
        "state": state,
        "solver": "mpc",
        "lifetime_s": 0.06,
        "valid": state is GaitState.FOLLOW,
    }
    return SupportCommand(**(fields | changes))


def gated(stop_at: int = 60, count: int = 120) -> tuple[list[Timed], list[Timed]]:
    """Return commands that a gate let through, stopping in the middle, and the motion of a drive without lag."""
    gate = SafetyGate(LIMITS, column_height_m=1.0)
    commands, motion = [], []
    executed = 0.0
    for k in range(count):
        now_ns = NS + k * PERIOD_NS
        state = GaitState.FOLLOW if k < stop_at else GaitState.SAFE_STOP
        out = gate.filter(command(now_ns, state=state, sequence=k), now_ns)
        pose = Odometry(stamp_ns=now_ns, position=[0, 0, 1], yaw=0.0, velocity=[executed, 0, 0], yaw_rate=0.0)
        motion.append(Timed(now_ns, pose, b"drive", k))
        commands.append(Timed(now_ns + 1, out, b"controller", k))
        executed = float(out.velocity[0])
    return commands, motion


def test_what_passes_the_gate_is_no_jump() -> None:
    commands, motion = gated()
    assert 0.9 < largest_jump(commands, LIMITS) < 1.01
    assert 0.9 < largest_motion_jump(motion, LIMITS) < 1.01


@pytest.mark.parametrize("at", [1, 50, 118])
def test_a_jump_is_seen_wherever_it_is(at: int) -> None:
    commands, motion = gated()
    leap = commands[at].message
    leap = command(leap.stamp_ns, velocity=float(leap.velocity[0]) + 0.1)
    commands[at] = commands[at]._replace(message=leap)
    assert largest_jump(commands, LIMITS) > 3.0
    pose = motion[at].message
    pose = Odometry(
        stamp_ns=pose.stamp_ns,
        position=[0, 0, 1],
        yaw=0.0,
        velocity=pose.velocity + np.array([0, 0.1, 0]),
        yaw_rate=0.0,
    )
    motion[at] = motion[at]._replace(message=pose)
    assert largest_motion_jump(motion, LIMITS) > 3.0


def test_a_lost_sample_is_no_jump_but_a_jump_over_it_is() -> None:
    _, motion = gated()
    assert largest_motion_jump([*motion[:62], *motion[63:]], LIMITS) < 1.01
    assert largest_motion_jump([*motion[:62], *motion[90:]], LIMITS) < 1.01
    torn = [m._replace(number=k) for k, m in enumerate([*motion[:62], *motion[90:]])]
    assert largest_motion_jump(torn, LIMITS) > 3.0, "numbered without a gap, so nothing was lost"


def test_a_new_process_may_begin_at_rest() -> None:
    commands, _ = gated(stop_at=1000)
    again = [c._replace(source=b"restarted", message=command(c.message.stamp_ns, 0.0)) for c in commands[60:]]
    assert largest_jump([*commands[:60], *again], LIMITS) < 1.01


@pytest.mark.parametrize("stop_at", [60, 75, 90])
def test_braking_is_dated_to_the_step_it_begins(stop_at: int) -> None:
    _, motion = gated(stop_at)
    began = braking_since(motion, NS + 40 * PERIOD_NS, LIMITS)
    assert began is not None
    assert (began - NS) // PERIOD_NS == stop_at


def test_a_walk_is_not_braking() -> None:
    _, motion = gated(stop_at=1000)
    assert braking_since(motion, NS, LIMITS) is None


def test_stop_and_follow_are_the_first_of_their_kind() -> None:
    commands, _ = gated(stop_at=60)
    stop = first_stop(commands, NS)
    assert stop is not None
    assert (stop.message.stamp_ns - NS) // PERIOD_NS == 60
    assert first_follow(commands, stop.arrival_ns) is None
    assert first_stop(commands[:60], NS) is None


GOOD = {topic: corpus(topic)[1::4] for topic in STREAMS}  # every fourth declares itself invalid


def carried(topic: Topic, number: int, stamp_ns: int) -> Carried:
    payload = GOOD[topic][number]
    return (
        Carried(payload, struct.pack("<qqB16s", number, stamp_ns, 16, b"p" * 16)).stamped(stamp_ns)._replace(good=True)
    )


@pytest.mark.parametrize("topic", STREAMS, ids=lambda topic: topic.key)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_spoils_what_it_says_it_spoils(fault: StreamFault, topic: Topic) -> None:
    start_ns = 1_700_000_000 * NS
    last = carried(topic, 0, start_ns)
    passage = fault.passage(topic, last)
    gone, bad, whole = 0, 0, 0
    for k in range(1, 60):
        now_ns = start_ns + k * PERIOD_NS
        out = passage.take(carried(topic, k % 7, now_ns), now_ns)
        if out is None:
            gone += 1
            continue
        try:
            message = decode(topic, out.payload, k)
            message.check()
            late_ns = now_ns + out.delay_ns - message.stamp_ns
            fine = 0 <= late_ns <= topic.max_age_s * NS
        except InvalidMessage:
            fine = False
        whole += fine and out.good
        bad += not fine
        assert not (out.good and not fine), "nothing spoilt passes for good"
    assert (whole > 0) == (not fault.stops or fault.name in ("slow", "intermittent"))
    assert (gone + bad > 0) == (fault.name not in ("late", "frozen"))


def test_the_table_is_written_between_its_marks_and_nothing_else_changes(tmp_path: Path) -> None:
    page, rows = tmp_path / "page.md", tmp_path / "rows.json"
    page.write_text(f"before\n{results.BEGIN}\nold\n{results.END}\nafter\n", encoding="utf-8")
    results.merge(rows, Outcome("off", "wrench", 100.0, 71.4, "wrench is 68 ms old", 0.99, 0.5))
    results.merge(rows, Outcome("garbage", "wrench", 100.0, None, "", 0.1, None, ("no safe command",)))
    results.merge(rows, Outcome("SIGKILL drive", "processes", 100.0, 66.0, "odom is 66 ms old", 1.0, 1.2))
    results.write_table(json.loads(rows.read_text()), page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old\n" not in text
    assert "| 71 (limit 100) |" in text
    assert "**failed**: no safe command" in text
    assert "SIGKILL drive" in text
    results.merge(rows, Outcome("off", "wrench", 100.0, 65.0, "again", 0.9, 0.5))
    results.write_table(json.loads(rows.read_text()), page)
    assert "| 65 (limit 100) |" in page.read_text(encoding="utf-8")


def test_a_page_without_a_place_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing here")
    with pytest.raises(SystemExit, match="no place for the table"):
        results.write_table({}, page)
