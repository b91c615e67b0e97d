"""In the place of perception and anticipation: keeps what the camera saw, and says what it is told to foresee."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from bridge.inbox import Inbox
from bridge.messages import KEYPOINTS, STEPS, FallHorizon, Keypoints, NodeStatus
from bridge.node import Factory, Node, NodeContext
from bridge.outbox import Outbox
from bridge.topics import DETECTIONS, FALL_HORIZON

CALM: Final = (0.98, 0.01, 0.01)
FALLING: Final = (0.0, 0.0, 1.0)
FAR_SD: Final = 5.0
NEAR_SD: Final = -1.0
FLICKER_SD: Final = 0.01  # the controller takes values that never change for those of a sender that is stuck


class TalkingCamera:
    """Keeps the detections and answers each with a horizon that needs no network."""

    period_s: float | None = None

    def __init__(self, context: NodeContext, seen: list[Keypoints], alarm: Callable[[], bool]) -> None:
        self._inbox = Inbox[Keypoints](context.transport, DETECTIONS, depth=16)
        self._outbox = Outbox(context.transport, FALL_HORIZON)
        self._seen, self._alarm = seen, alarm

    def step(self, now_ns: int) -> None:
        """Take what has come."""
        for message in self._inbox.drain(now_ns):
            self._seen.append(message)
            self._outbox.send(horizon(message.stamp_ns, self._alarm(), FLICKER_SD * (len(self._seen) % 2)))

    def wait(self) -> None:
        """Stepped in simulated time only."""

    def status(self, now_ns: int) -> NodeStatus:
        """Say nothing of note."""
        return NodeStatus(stamp_ns=now_ns, role="anticipation", level=0, summary="says what it is told")

    def finished(self) -> bool:
        """Never."""
        return False

    def close(self) -> None:
        """Leave the wire."""
        self._inbox.close()
        self._outbox.close()


def horizon(stamp_ns: int, falling: bool, aside_sd: float) -> FallHorizon:
    """Return a horizon that is sure of itself, its distances `aside_sd` further than they would be."""
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=np.tile(FALLING if falling else CALM, (STEPS, 1)),
        distance=np.full(STEPS, aside_sd + (NEAR_SD if falling else FAR_SD)),
        distance_rate=np.zeros(STEPS),
        time_to_boundary=np.full(STEPS, 0.0 if falling else np.inf),
        centre_distance=np.ones((STEPS, 3)),
        plane=np.zeros((STEPS, 2)),
        forecast_px=np.zeros((STEPS, KEYPOINTS, 2)),
        quality=1.0,
    )


def talking_camera(seen: list[Keypoints], alarm: Callable[[], bool]) -> Factory:
    """Return what makes a node that keeps detections in `seen` and foresees a fall while `alarm` says so."""

    def factory(context: NodeContext) -> Node:
        return TalkingCamera(context, seen, alarm)

    return factory
