"""A sensor that repeats itself under new stamps is told from one that lives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bridge.clock import NS, ManualClock, nanoseconds
from bridge.errors import InvalidMessage
from bridge.inbox import Inbox
from bridge.messages import FallHorizon, Keypoints, KeypointStatus, Odometry, SupportCommand, Wrench
from bridge.outbox import Outbox
from bridge.stuck import StuckWatch
from bridge.topics import WRENCH
from bridge.transport.memory import MemoryHub

LIMIT_S = 0.3
PERIOD_NS = nanoseconds(0.01)


def keypoints(x: float = 100.0) -> Keypoints:
    position = np.full((12, 2), x)
    position[4] = np.nan
    status = np.zeros(12, dtype=np.uint8)
    status[4] = KeypointStatus.LOST
    return Keypoints(
        stamp_ns=0, position_px=position, confidence=np.ones(12), status=status,
        body_length_px=80.0, image_width=320, image_height=240,
    )  # fmt: skip


def horizon(distance: float = 2.0) -> FallHorizon:
    return FallHorizon(
        stamp_ns=0, probabilities=np.tile([0.8, 0.1, 0.1], (16, 1)), distance=np.full(16, distance),
        distance_rate=np.zeros(16), time_to_boundary=np.full(16, np.inf), centre_distance=np.ones((16, 3)),
        plane=np.ones((16, 2)), forecast_px=np.ones((16, 12, 2)), quality=1.0,
    )  # fmt: skip


def wrench(x: float = 20.0) -> Wrench:
    return Wrench(stamp_ns=0, force=np.array([x, 0.0, 0.0]), torque=np.zeros(3))


def odometry(speed: float = 0.5, x: float = 1.0) -> Odometry:
    return Odometry(
        stamp_ns=0, position=np.array([x, 0.0, 1.0]), yaw=0.0, velocity=np.array([speed, 0.0, 0.0]), yaw_rate=0.0
    )


def command() -> SupportCommand:
    zeros = np.zeros(4)
    return SupportCommand(
        stamp_ns=0, velocity=zeros, acceleration=zeros, column_height=1.0, stiffening=0.0, damping=zeros,
        stiffness=zeros, state="DISARMED", solver="stop", lifetime_s=0.06,
    )  # fmt: skip


def first_refused(make: Callable[[int], Any], steps: int = 60) -> int | None:
    """Return the number of the first message that is refused as stuck, None if none is."""
    watch = StuckWatch("thing", LIMIT_S)
    for number in range(steps):
        try:
            watch.judge(replace(make(number), stamp_ns=NS + number * PERIOD_NS))
        except InvalidMessage:
            return number
    return None


@pytest.mark.parametrize("make", [keypoints, horizon, wrench, odometry], ids=lambda make: make.__name__)
def test_the_same_values_under_new_stamps_are_refused_after_the_limit(make: Callable[[], Any]) -> None:
    assert first_refused(lambda _: make()) == round(LIMIT_S * NS / PERIOD_NS) + 1


@pytest.mark.parametrize(
    "make",
    [
        lambda k: keypoints(100.0 + 1e-3 * (k % 2)),
        lambda k: horizon(2.0 + 1e-9 * (k % 2)),
        lambda k: wrench(20.0 + 1e-9 * (k % 2)),
        lambda k: odometry(x=0.005 * k),
        lambda k: odometry(0.0),  # at rest
        lambda k: wrench(0.0),  # untouched, with a dead band
        lambda k: command(),  # a walker that holds says so again and again
        lambda k: replace(keypoints(), status=np.full(12, 2), position_px=np.full((12, 2), np.nan)),  # nobody there
    ],
    ids=["moves", "horizon", "noise", "drives", "rests", "untouched", "command", "nobody"],
)
def test_what_lives_or_rests_is_let_through(make: Callable[[int], Any]) -> None:
    assert first_refused(make) is None


def test_zero_switches_it_off() -> None:
    watch = StuckWatch("thing", 0.0)
    for number in range(100):
        watch.judge(replace(wrench(), stamp_ns=number * PERIOD_NS))


def test_an_inbox_lets_a_stuck_stream_grow_old_names_it_and_forgives_it() -> None:
    clock = ManualClock(NS)
    hub = MemoryHub(clock)
    inbox = Inbox[Wrench](hub.transport(), WRENCH, stuck_after_s=LIMIT_S)
    outbox = Outbox(hub.transport(), WRENCH)
    for _ in range(40):
        outbox.send(replace(wrench(), stamp_ns=clock.now_ns()))
        reading = inbox.read(clock.now_ns())
        clock.advance(0.01)
    assert reading.fault == "wrench is stuck: the same values for 390 ms, limit 300"
    assert reading.age_s == pytest.approx(0.09), "the age of the last that was believed"
    outbox.send(replace(wrench(21.0), stamp_ns=clock.now_ns()))
    assert inbox.read(clock.now_ns()).ok
