"""Good payloads of every type, different enough to reach every branch of a decoder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from bridge.codec import encode
from bridge.messages import (
    FallHorizon,
    GaitState,
    Keypoints,
    KeypointStatus,
    Message,
    NodeStatus,
    Odometry,
    SupportCommand,
    Wrench,
)
from bridge.topics import Topic

STAMP_NS: Final = 1_795_334_344_860_158_123
SIZE: Final = 32


def corpus(topic: Topic, size: int = SIZE) -> list[bytes]:
    """Return `size` valid payloads of `topic`."""
    rng = np.random.default_rng(7)
    return [encode(topic, _MAKERS[topic.message](rng, number)) for number in range(size)]


def _words(rng: np.random.Generator) -> str:
    return "über "[: int(rng.integers(0, 6))] + "x" * int(rng.integers(0, 40))


def keypoints(rng: np.random.Generator, number: int) -> Keypoints:
    status = rng.integers(0, 3, 12).astype(np.uint8)
    position = rng.uniform(0, 300, (12, 2))
    position[status == KeypointStatus.LOST] = np.nan
    return Keypoints(
        stamp_ns=STAMP_NS + number,
        sequence=number,
        valid=number % 4 != 0,
        reason=_words(rng) if number % 4 == 0 else "",
        position_px=position,
        confidence=rng.uniform(0, 1, 12),
        status=status,
        body_length_px=float(rng.uniform(20, 200)),
        image_width=320,
        image_height=240,
        people=int(rng.integers(0, 4)),
    )


def horizon(rng: np.random.Generator, number: int) -> FallHorizon:
    return FallHorizon(
        stamp_ns=STAMP_NS + number,
        sequence=number,
        valid=number % 4 != 0,
        reason=_words(rng) if number % 4 == 0 else "",
        probabilities=rng.dirichlet([1, 1, 1], 16),
        distance=rng.normal(size=16),
        distance_rate=rng.normal(size=16),
        time_to_boundary=np.where(rng.uniform(size=16) < 0.5, np.inf, rng.uniform(0, 2, 16)),
        centre_distance=rng.uniform(0, 5, (16, 3)),
        plane=rng.normal(size=(16, 2)),
        forecast_px=rng.uniform(0, 300, (16, 12, 2)),
        quality=float(rng.uniform(0, 1)),
    )


def command(rng: np.random.Generator, number: int) -> SupportCommand:
    return SupportCommand(
        stamp_ns=STAMP_NS + number,
        sequence=number,
        valid=number % 4 != 0,
        velocity=rng.uniform(-0.4, 0.4, 4),
        acceleration=rng.uniform(-1, 1, 4),
        column_height=float(rng.uniform(0.7, 1.2)),
        stiffening=float(rng.uniform(0, 1)),
        damping=rng.uniform(0, 100, 4),
        stiffness=rng.uniform(0, 1000, 4),
        state=list(GaitState)[number % len(GaitState)],
        solver=("mpc", "fallback", "stop")[number % 3],
        lifetime_s=0.06,
        reason=_words(rng),
        rests_on_ns=STAMP_NS - number if number % 2 else 0,
        fall_distance=float("nan") if number % 5 == 0 else 1.0,
    )


def wrench(rng: np.random.Generator, number: int) -> Wrench:
    return Wrench(stamp_ns=STAMP_NS + number, force=rng.uniform(-600, 600, 3), torque=rng.uniform(-50, 50, 3))


def odometry(rng: np.random.Generator, number: int) -> Odometry:
    return Odometry(
        stamp_ns=STAMP_NS + number,
        position=rng.uniform(-9, 9, 3),
        yaw=float(rng.uniform(-3, 3)),
        velocity=rng.uniform(-1, 1, 3),
        yaw_rate=float(rng.uniform(-1, 1)),
    )


def status(rng: np.random.Generator, number: int) -> NodeStatus:
    values = {f"key{k}": _words(rng) for k in range(int(rng.integers(0, 6)))}
    return NodeStatus(stamp_ns=STAMP_NS + number, role="drive", level=number % 4, summary=_words(rng), values=values)


_MAKERS: Final[Mapping[type[Message], Callable[[np.random.Generator, int], Message]]] = {
    Keypoints: keypoints,
    FallHorizon: horizon,
    SupportCommand: command,
    Wrench: wrench,
    Odometry: odometry,
    NodeStatus: status,
}
