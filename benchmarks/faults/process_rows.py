"""Faults of whole processes: killed, frozen, restarted in an arrest, started twice, beside another robot."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final, NamedTuple

from benchmarks.faults.judge import (
    MS,
    STOPPED,
    Outcome,
    Timed,
    braking_since,
    first_follow,
    first_stop,
    largest_jump,
    largest_motion_jump,
)
from benchmarks.faults.stream_rows import AFTER_S, BEFORE_S, LIMIT_MS, disturbed, speeding_up, timed
from benchmarks.faults.system import DirectSystem
from bridge.clock import nanoseconds
from bridge.latency.system import ROLES
from bridge.messages import GaitState
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from controller.gate import GateLimits

FREEZE_S: Final = 1.0
RESTART_LIMIT_S: Final = 60.0  # a process loads its libraries again, on a machine that may be busy
SPOKESMAN: Final[dict[str, Topic]] = {
    "perception": KEYPOINTS,
    "anticipation": FALL_HORIZON,
    "controller": SUPPORT_COMMAND,
    "drive": WRENCH,
}
WORDS: Final = {
    "perception": "horizon|keypoint",
    "anticipation": "horizon",
    "controller": "command",
    "drive": "wrench|odom",
}
STIFF: Final = 0.9
SUNK_LIMIT_M: Final = 0.05  # half of what an arrest may take


class ProcessRow(NamedTuple):
    """A row and how to run it."""

    group: str
    row: str
    run: Callable[[DirectSystem], Outcome]


def killed(system: DirectSystem, role: str) -> Outcome:
    """SIGKILL: the process is gone at once; `surefoot up` starts it again."""
    return _interrupted(system, f"SIGKILL {role}", role, lambda: system.signal(role, signal.SIGKILL), lambda: None)


def frozen(system: DirectSystem, role: str) -> Outcome:
    """SIGSTOP for a second, then SIGCONT: the process wakes up with old inputs and an old idea of now."""

    def wake() -> None:
        system.run_for(FREEZE_S)
        system.signal(role, signal.SIGCONT)

    return _interrupted(system, f"SIGSTOP {role}", role, lambda: system.signal(role, signal.SIGSTOP), wake)


def _interrupted(
    system: DirectSystem, row: str, role: str, strike: Callable[[], None], end: Callable[[], None]
) -> Outcome:
    if not system.until(system.walking, f"{row}: walking", 60.0):
        return Outcome(row, "processes", None, None, "", 0.0, None, ("the walker did not walk before the fault",))
    system.run_for(BEFORE_S)
    system.forget(BEFORE_S)
    system.run_for(0.1)
    began_ns = system.clock.now_ns()
    strike()
    end()
    ended_ns = system.clock.now_ns()

    def back_ns() -> int | None:
        # the walker moves again, on the word of the controller and of the drive
        stopped_ns = stop_ns()
        if stopped_ns is None:
            return None
        # who was frozen may say one thing more that it had in mind before
        after_ns = max(ended_ns, stopped_ns, began_ns + nanoseconds(0.2))
        word = first_follow(timed(system, SUPPORT_COMMAND), after_ns)
        return None if word is None else speeding_up(timed(system, ODOMETRY), word.arrival_ns)

    def stop_ns() -> int | None:
        if role == "controller":
            return braking_since(timed(system, ODOMETRY), began_ns, GateLimits(**system.gate.model_dump()))
        stop = first_stop(timed(system, SUPPORT_COMMAND), began_ns)
        return None if stop is None else stop.arrival_ns

    system.until(lambda: back_ns() is not None, f"{row}: back", RESTART_LIMIT_S)
    system.run_for(AFTER_S)
    return _judged(system, row, role, began_ns, ended_ns, stop_ns(), back_ns())


def _judged(
    system: DirectSystem, row: str, role: str, began_ns: int, ended_ns: int, stop_ns: int | None, back_ns: int | None
) -> Outcome:
    limits = GateLimits(**system.gate.model_dump())
    commands, motion = timed(system, SUPPORT_COMMAND), timed(system, ODOMETRY)
    problems: list[str] = []
    jump = max(largest_jump(commands, limits), largest_motion_jump(motion, limits))
    if jump > 1.02:
        problems.append(f"jump: {jump:.2f} of what the gate allows")
    limit_ms, safe_ms = LIMIT_MS[SPOKESMAN[role]], None
    good = [m.message.stamp_ns for m in timed(system, SPOKESMAN[role]) if m.arrival_ns <= (stop_ns or 0)]
    if stop_ns is None or not good:
        problems.append("no safe command")
    else:
        safe_ms = (stop_ns - max(good)) / MS
        if safe_ms > limit_ms:
            problems.append(f"safe after {safe_ms:.0f} ms, limit {limit_ms:.0f}")
    stops = (c for c in commands if c.arrival_ns >= (stop_ns or began_ns) and c.message.state in STOPPED)
    reasons = [c.message.reason for c in stops]
    if role == "controller":
        held = [s.summary for s in system.statuses("drive") if s.stamp_ns > began_ns and s.summary.startswith("holds")]
        reasons = [text.removeprefix("holds: ") for text in held]
    reason = next((r for r in reasons if re.search(WORDS[role], r)), reasons[0] if reasons else "")
    if not re.search(WORDS[role], reason):
        problems.append(f"the reason does not name what is missing: '{reason}'")
    if back_ns is None:
        problems.append(f"not back at work within {RESTART_LIMIT_S:g} s")
    back_s = None if back_ns is None else (back_ns - ended_ns) / 1e9
    return Outcome(row, "processes", limit_ms, safe_ms, reason, jump, back_s, tuple(problems))


def restarted_in_arrest(system: DirectSystem, role: str) -> Outcome:
    """SIGKILL while the person hangs in the harness: the walker stays stiff and is in ARREST again by itself."""
    row = f"{role} in ARREST"
    arrested = system.until(lambda: arresting(system), f"{row}: arrest", 60.0)
    if not arrested:
        return Outcome(row, "arrest", None, None, "", 0.0, None, ("no arrest before the fault",))
    system.run_for(BEFORE_S)
    system.forget(BEFORE_S)
    began_ns = system.clock.now_ns()
    pid = system.processes[role].pid
    system.signal(role, signal.SIGKILL)
    system.until(lambda: system.processes[role].pid != pid, f"{row}: restart", 10.0)
    # the drive without a robot starts its script again, so there the next arrest is that of the next fall
    again = system.until(lambda: _arrest_after(system, began_ns, role) is not None, f"{row}: again", RESTART_LIMIT_S)
    system.run_for(AFTER_S)
    limits = GateLimits(**system.gate.model_dump())
    commands, motion = timed(system, SUPPORT_COMMAND), timed(system, ODOMETRY)
    problems = [] if again else [f"not in ARREST again within {RESTART_LIMIT_S:g} s"]
    jump = max(largest_jump(commands, limits), largest_motion_jump(motion, limits))
    if jump > 1.02:
        problems.append(f"jump: {jump:.2f} of what the gate allows")
    since_ns = _arrest_after(system, began_ns, role)
    between = [c for c in commands if began_ns <= c.arrival_ns <= (since_ns or began_ns)]
    loose = [c for c in between if c.message.valid and c.message.stiffening < STIFF]
    if loose and role != "drive":
        softest = min(c.message.stiffening for c in loose)
        problems.append(f"{len(loose)} commands to follow with stiffening down to {softest:.2f}")
    sunk_m = _sunk(motion, began_ns) if role != "drive" else 0.0
    if sunk_m > SUNK_LIMIT_M:
        problems.append(f"the column sank by {sunk_m * 1e3:.0f} mm")
    stop = first_stop(commands, began_ns)
    reason = "" if stop is None else stop.message.reason
    again_s = None if since_ns is None else (since_ns - began_ns) / 1e9
    return Outcome(row, "arrest", None, None, reason, jump, again_s, tuple(problems), f"sank {sunk_m * 1e3:.0f} mm")


def _arrest_after(system: DirectSystem, began_ns: int, role: str) -> int | None:
    """Return when the controller was in ARREST for good after the fault, and not still in the arrest before it."""
    commands = timed(system, SUPPORT_COMMAND)
    changed = [
        c.arrival_ns
        for c in commands
        if c.arrival_ns > began_ns
        and (c.message.state is not GaitState.ARREST or (role == "controller" and c.source != commands[0].source))
    ]
    if not changed:
        return None
    return next(
        (
            c.arrival_ns
            for c in commands
            if c.arrival_ns >= changed[0] and c.message.state is GaitState.ARREST and c.message.stiffening > STIFF
        ),
        None,
    )


def _sunk(motion: Sequence[Timed], since_ns: int) -> float:
    heights = [float(m.message.position[2]) for m in motion if m.arrival_ns >= since_ns]
    return max(0.0, heights[0] - min(heights)) if heights else 0.0


def duplicated(system: DirectSystem, role: str) -> Outcome:
    """A second process of a role that got on the wire at another endpoint: the first is followed, the second named."""
    row = f"second {role}"
    if not system.until(system.walking, f"{row}: walking", 60.0):
        return Outcome(row, "company", None, None, "", 0.0, None, ("the walker did not walk before the fault",))
    problems: list[str] = []
    refused = _start_twice(system, role)
    if "the port is in use" not in refused:
        problems.append(f"one more at the same endpoint said: '{refused}'")
    system.run_for(BEFORE_S)
    system.forget(BEFORE_S)
    began_ns = system.clock.now_ns()
    with DirectSystem(
        [f'launch.roles=["{role}"]'],
        namespace=system.config.bridge.namespace,
        connect=[f"tcp/127.0.0.1:{port}" for name, port in system.ports.items() if name in ROLES],
    ) as other:
        _start_beside(other, [role])

        def named() -> bool:
            other.look()
            return any("two publishers" in s.summary for reader in ROLES for s in system.statuses(reader))

        if not system.until(named, f"{row}: named", RESTART_LIMIT_S):
            problems.append(f"no process said that there are two publishers; the second: {other.describe()}")
        system.run_for(1.0)
    system.run_for(1.0)
    said = next((s.summary for r in ROLES for s in system.statuses(r) if "two publishers" in s.summary), "")
    return _undisturbed(system, row, "company", began_ns, said, problems)


def _start_beside(other: DirectSystem, roles: Sequence[str]) -> None:
    """Start processes that in earnest would have a computer of their own: they get only the time that is left."""
    for role in roles:
        other.launchers[role].start([role])
        os.setpriority(os.PRIO_PROCESS, other.launchers[role].poll()[role].pid, 19)


def _start_twice(system: DirectSystem, role: str) -> str:
    words = [word for override in system.overrides for word in ("--set", override)]
    command = [sys.executable, "-m", system.config.launch.modules[role], *words]
    if role == "perception":
        command += ["--option", f"source={system.options['perception']['source']}"]
    with subprocess.Popen(["nice", "-n", "19", *command], stderr=subprocess.PIPE, text=True) as process:
        system.until(lambda: process.poll() is not None, f"one more {role}", 60.0)
        if process.poll() is None:
            process.kill()
        assert process.stderr is not None
        return process.stderr.read().strip()


def second_robot(system: DirectSystem) -> Outcome:
    """Another robot, all of it, linked to every process of this one: its namespace keeps them apart."""
    row = "second robot"
    if not system.until(system.walking, f"{row}: walking", 60.0):
        return Outcome(row, "company", None, None, "", 0.0, None, ("the walker did not walk before the fault",))
    system.forget(BEFORE_S)
    began_ns = system.clock.now_ns()
    problems: list[str] = []
    sources = {topic: {entry.source for entry in system.heard[topic.key]} for topic in LIMIT_MS}
    with DirectSystem(
        namespace="another-robot",
        connect=[f"tcp/127.0.0.1:{port}" for name, port in system.ports.items() if name in ROLES],
        options={"controller": {"controller": "log"}},
    ) as other:
        _start_beside(other, ROLES)

        def moves() -> bool:
            other.look()
            command = other.command()
            return command is not None and command.valid

        if not system.until(moves, f"{row}: follows", 90.0):
            problems.append(f"the second robot does not work: {other.describe()}")
        for role in ROLES:
            if other.running(role):
                other.signal(role, signal.SIGKILL)
        system.run_for(1.0)
    heard = {topic: {entry.source for entry in system.heard[topic.key]} for topic in LIMIT_MS}
    if heard != sources:
        problems.append("the listener of the first robot heard the second")
    return _undisturbed(system, row, "company", began_ns, "", problems)


def _undisturbed(system: DirectSystem, row: str, group: str, began_ns: int, said: str, problems: list[str]) -> Outcome:
    limits = GateLimits(**system.gate.model_dump())
    commands, motion = timed(system, SUPPORT_COMMAND), timed(system, ODOMETRY)
    if commands:
        commands = [c for c in commands if c.source == commands[0].source]
    if motion:
        motion = [m for m in motion if m.source == motion[0].source]
    jump = max(largest_jump(commands, limits), largest_motion_jump(motion, limits))
    if jump > 1.02:
        problems.append(f"jump: {jump:.2f} of what the gate allows")
    problems += disturbed(system, row, commands, motion, began_ns)
    return Outcome(row, group, None, None, said, jump, None, tuple(problems))


def _rows() -> Iterator[ProcessRow]:
    for role in ROLES:
        yield ProcessRow("processes", f"SIGKILL {role}", partial(killed, role=role))
    for role in ROLES:
        yield ProcessRow("processes", f"SIGSTOP {role}", partial(frozen, role=role))
    for role in ROLES:
        yield ProcessRow("company", f"second {role}", partial(duplicated, role=role))
    yield ProcessRow("company", "second robot", second_robot)
    for role in ROLES:
        yield ProcessRow("arrest", f"{role} in ARREST", partial(restarted_in_arrest, role=role))


PROCESS_ROWS: Final = tuple(_rows())


def hanging_system() -> DirectSystem:
    """Return a system, not started, whose person falls into the harness after a few steps and hangs there."""
    return DirectSystem(script="fall", event_s="6", fall_hold_s="3000")


def arresting(system: DirectSystem) -> bool:
    """Whether the walker is stiff in an arrest."""
    command = system.command()
    return command is not None and command.state is GaitState.ARREST and command.stiffening > STIFF
