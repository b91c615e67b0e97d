"""One row: a fault happens to one stream of a walking system, ends, and the system is watched all the while."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from benchmarks.faults.judge import (
    MS,
    Outcome,
    Timed,
    braking_since,
    first_follow,
    first_stop,
    largest_jump,
    largest_motion_jump,
    lowest_speed,
)
from benchmarks.faults.stream_faults import StreamFault
from benchmarks.faults.system import RelayedSystem, System
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from controller.gate import GateLimits

# what the safe command may take from the stamp of the last good sample on [ms]
LIMIT_MS: Final = {KEYPOINTS: 200.0, FALL_HORIZON: 200.0, WRENCH: 100.0, ODOMETRY: 100.0, SUPPORT_COMMAND: 100.0}
NAMES: Final = {
    "keypoints": KEYPOINTS,
    "horizon": FALL_HORIZON,
    "wrench": WRENCH,
    "odometry": ODOMETRY,
    "command": SUPPORT_COMMAND,
}
WORDS: Final = {
    "keypoints": "keypoint",
    "horizon": "horizon",
    "wrench": "wrench",
    "odometry": "odom",
    "command": "command",
}
BEFORE_S: Final = 0.3
AFTER_S: Final = 0.3
BACK_LIMIT_S: Final = 5.0


def run_stream_row(system: RelayedSystem, stream: str, fault: StreamFault) -> Outcome:
    """Let `fault` happen to `stream` once and judge what came of it."""
    topic = NAMES[stream]
    if not system.until(system.walking, f"{stream} {fault.name}: walking", 30.0):
        return Outcome(fault.name, stream, None, None, "", 0.0, None, ("the walker did not walk before the fault",))
    system.run_for(BEFORE_S)
    system.forget(BEFORE_S)
    system.relay.delivered[topic.key].clear()
    system.run_for(0.1)
    began_ns = system.clock.now_ns()
    system.relay.inject(topic, fault)
    system.run_for(fault.lasts_s)
    system.relay.mend(topic)
    ended_ns = system.clock.now_ns()
    system.until(lambda: back(system, topic, ended_ns) is not None, f"{stream} {fault.name}: back", BACK_LIMIT_S)
    system.run_for(AFTER_S)
    return judge(system, stream, fault, began_ns, ended_ns)


def timed(system: System, topic: Topic) -> list[Timed]:
    """Return what was heard on `topic`, in order."""
    return [Timed(entry.arrival_ns, entry.message, entry.source, entry.sequence) for entry in system.heard[topic.key]]


def back(system: System, topic: Topic, ended_ns: int) -> int | None:
    """Return when the walker followed again after the end of the fault [ns], None if it does not."""
    if topic is SUPPORT_COMMAND:
        return speeding_up(timed(system, ODOMETRY), ended_ns)
    again = first_follow(timed(system, SUPPORT_COMMAND), ended_ns)
    return None if again is None else again.arrival_ns


def speeding_up(motion: Sequence[Timed], since_ns: int) -> int | None:
    """Return when the drive moved forward and faster than at the sample before, after `since_ns`."""
    for before, after in pairwise(motion):
        speed = float(after.message.velocity[0])
        if after.arrival_ns >= since_ns and speed > 0.02 and speed > float(before.message.velocity[0]) + 1e-4:
            return after.arrival_ns
    return None


def judge(system: RelayedSystem, stream: str, fault: StreamFault, began_ns: int, ended_ns: int) -> Outcome:
    """Return the row from what was heard."""
    topic = NAMES[stream]
    limits = GateLimits(**system_gate(system))
    commands, motion = timed(system, SUPPORT_COMMAND), timed(system, ODOMETRY)
    good = [d for d in system.relay.delivered[topic.key] if d.good]
    jump = max(largest_jump(commands, limits), largest_motion_jump(motion, limits))
    problems: list[str] = []
    if jump > 1.02:
        problems.append(f"jump: {jump:.2f} of what the gate allows")
    if not fault.stops:
        problems += disturbed(system, stream, commands, motion, began_ns)
        return Outcome(fault.name, stream, None, None, "", jump, None, tuple(problems))
    if stream == "command":
        stopped_ns = braking_since(motion, began_ns, limits)
        reason = next(
            (s.summary for s in system.statuses("drive") if s.stamp_ns > began_ns and s.summary.startswith("holds")), ""
        ).removeprefix("holds: ")
    else:
        stop = first_stop(commands, began_ns)
        stopped_ns, reason = (None, "") if stop is None else (stop.arrival_ns, said(commands, stream, stop, ended_ns))
    safe_ms = None
    limit_ms = LIMIT_MS[topic] + fault.notice_s.get(stream, 0.0) * 1e3
    if stopped_ns is None:
        problems.append("no safe command")
    else:
        since_ns = max((d.stamp_ns for d in good if d.at_ns <= stopped_ns), default=None)
        if fault.notice_s:  # what is wrong with the samples shows only in their lasting
            since_ns = max((d.stamp_ns for d in good if d.at_ns <= began_ns), default=None)
        if since_ns is None:
            problems.append("no good sample before the fault")
        else:
            safe_ms = (stopped_ns - since_ns) / MS
            if safe_ms > limit_ms:
                problems.append(f"safe after {safe_ms:.0f} ms, limit {limit_ms:.0f}")
    if not reason or not re.search(WORDS[stream], reason):
        problems.append(f"the reason does not name {stream}: '{reason}'")
    back_ns = back(system, topic, ended_ns)
    if back_ns is None:
        problems.append(f"not back at work within {BACK_LIMIT_S:g} s")
    back_s = None if back_ns is None else (back_ns - ended_ns) / 1e9
    return Outcome(fault.name, stream, limit_ms, safe_ms, reason, jump, back_s, tuple(problems))


def said(commands: Sequence[Timed], stream: str, stop: Timed, ended_ns: int) -> str:
    """Return the reason that names the stream: with a fault further up it comes a moment after the first."""
    lasting: list[str] = [c.message.reason for c in commands if stop.arrival_ns <= c.arrival_ns <= ended_ns]
    return next((reason for reason in lasting if re.search(WORDS[stream], reason)), lasting[0])


def disturbed(
    system: System, stream: str, commands: Sequence[Timed], motion: Sequence[Timed], began_ns: int
) -> list[str]:
    """Return what shows that work did not go on."""
    problems = []
    stop = first_stop(commands, began_ns)
    if stop is not None:
        problems.append(f"stopped: {stop.message.reason}")
    held = [s.summary for s in system.statuses("drive") if s.stamp_ns > began_ns and s.summary.startswith("holds")]
    if held:
        problems.append(f"the drive {held[0]}")
    before = lowest_speed(motion, 0, began_ns)
    lowest = lowest_speed(motion, began_ns, system.clock.now_ns())
    if not lowest > 0.5 * before:
        problems.append(f"{stream}: slowed down from {before:.2f} to {lowest:.2f} m/s")
    return problems


def system_gate(system: System) -> dict[str, float]:
    """Return the limits that every process was given."""
    return system.gate.model_dump()
