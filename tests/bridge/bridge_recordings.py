"""Recordings of a made-up walk: what the tests of record, info and replay read and write."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bridge.clock import NS
from bridge.codec import encode
from bridge.messages import (
    FallHorizon,
    GaitState,
    Keypoints,
    Message,
    NodeStatus,
    Odometry,
    SupportCommand,
    Wrench,
)
from bridge.record.writer import BagWriter
from bridge.topics import (
    DETECTIONS,
    DIAGNOSTICS,
    FALL_HORIZON,
    KEYPOINTS,
    ODOMETRY,
    SUPPORT_COMMAND,
    TOPICS,
    TWIST,
    WRENCH,
    Topic,
)
from bridge.transport.interface import Sample

START_NS = 1_795_334_344_860_158_123
NAMESPACE = "surefoot"
SOURCES = {
    role: bytes([index]) * 16
    for index, role in enumerate(("perception", "anticipation", "controller", "drive"), start=1)
}
DELAY_NS = 300_000  # from a message's stamp to its arrival
STANDING = np.array(  # [px]
    [
        [(140, 80), (180, 80)],  # shoulders, left and right
        [(135, 115), (185, 115)],  # elbows
        [(133, 145), (187, 145)],  # wrists
        [(147, 150), (173, 150)],  # hips
        [(147, 190), (173, 190)],  # knees
        [(147, 228), (173, 228)],  # ankles
    ],
    dtype=float,
).reshape(12, 2)


class Event(NamedTuple):
    """A message, and when it arrives."""

    topic: Topic
    message: Message
    sample: Sample


def keypoints(stamp_ns: int, sequence: int = 0) -> Keypoints:
    time_s = (stamp_ns - START_NS) / NS
    sway = np.array([6.0 * math.sin(2 * math.pi * 0.9 * time_s), 1.5 * math.cos(2 * math.pi * 1.8 * time_s)])
    return Keypoints(
        stamp_ns=stamp_ns,
        sequence=sequence,
        position_px=STANDING + sway,
        confidence=np.full(12, 0.9),
        status=np.zeros(12, np.uint8),
        body_length_px=150.0,
        image_width=320,
        image_height=240,
    )


def horizon(stamp_ns: int, sequence: int = 0, fall: float = 0.02) -> FallHorizon:
    probabilities = np.tile([1.0 - 2.0 * fall, fall, fall], (16, 1))
    return FallHorizon(
        stamp_ns=stamp_ns,
        sequence=sequence,
        probabilities=probabilities,
        distance=np.linspace(4.0, 3.0, 16) + 1e-6 * (sequence % 2),  # what is measured is never twice the same
        distance_rate=np.full(16, -2.0),
        time_to_boundary=np.full(16, np.inf),
        centre_distance=np.full((16, 3), 2.0),
        plane=np.zeros((16, 2)),
        forecast_px=np.tile(STANDING, (16, 1, 1)),
        quality=0.95,
    )


def command(stamp_ns: int, sequence: int = 0) -> SupportCommand:
    return SupportCommand(
        stamp_ns=stamp_ns,
        sequence=sequence,
        velocity=[0.4, 0.0, 0.05, 0.0],
        acceleration=[0.1, 0.0, 0.0, 0.0],
        column_height=0.95,
        stiffening=0.1,
        damping=[30, 30, 10, 200],
        stiffness=[0, 0, 0, 0],
        state=GaitState.FOLLOW,
        solver="mpc",
        lifetime_s=0.06,
        rests_on_ns=stamp_ns - 20_000_000,
    )


def _message(topic: Topic, stamp_ns: int, sequence: int, role: str) -> Message:
    time_s = (stamp_ns - START_NS) / NS
    if topic in (DETECTIONS, KEYPOINTS):
        return keypoints(stamp_ns, sequence)
    if topic == FALL_HORIZON:
        return horizon(stamp_ns, sequence)
    if topic == WRENCH:
        force = [15.0 + 5.0 * math.sin(2 * math.pi * time_s), 0.0, -20.0]
        return Wrench(stamp_ns=stamp_ns, force=force, torque=[0.0, 0.0, 0.3])
    if topic == ODOMETRY:
        position = [0.4 * time_s, 0.0, 0.95]
        return Odometry(stamp_ns=stamp_ns, position=position, yaw=0.0, velocity=[0.4, 0, 0], yaw_rate=0.0)
    if topic in (SUPPORT_COMMAND, TWIST):
        return command(stamp_ns, sequence)
    return NodeStatus(stamp_ns=stamp_ns, role=role, level=0, summary="as it should be", values={"rate_hz": "100.0"})


def walk(duration_s: float, start_ns: int = START_NS, topics: tuple[Topic, ...] = TOPICS) -> list[Event]:
    """Return what arrives in `duration_s` of the whole system, in order of arrival."""
    events: list[Event] = []
    for topic in topics:
        roles = SOURCES if topic == DIAGNOSTICS else (topic.publisher,)
        for offset, role in enumerate(roles):
            for sequence in range(math.ceil(duration_s * topic.rate_hz)):
                stamp_ns = start_ns + round(sequence * NS / topic.rate_hz) + 1000 * offset
                message = _message(topic, stamp_ns, sequence, role)
                sample = Sample(encode(topic, message), sequence, SOURCES[role], stamp_ns + DELAY_NS)
                events.append(Event(topic, message, sample))
    return sorted(events, key=lambda event: event.sample.arrival_ns)


def write(out: Path, events: list[Event], topics: tuple[Topic, ...] = TOPICS) -> Path:
    """Write a whole recording of `events`, a chunk for every half second, and return its path."""
    writer = BagWriter(out, NAMESPACE, topics)
    for _ in write_slowly(writer, events):
        writer.flush()
    writer.finish()
    return out


def write_slowly(writer: BagWriter, events: list[Event], period_s: float = 0.5) -> Iterator[int]:
    """Write `events`, pausing after every `period_s` of them with how many were written."""
    due_ns = events[0].sample.arrival_ns + round(period_s * NS)
    for count, (topic, _, sample) in enumerate(events):
        if sample.arrival_ns >= due_ns:
            due_ns += round(period_s * NS)
            yield count
        writer.write(topic, sample)
    yield len(events)
