"""Perception and anticipation as the wire sees them, at any rate: no camera and no network runs ten times as fast."""

from __future__ import annotations

import sys

import numpy as np

from bridge.inbox import Inbox
from bridge.messages import STEPS, FallHorizon, Keypoints, NodeStatus
from bridge.node import Node, NodeContext, main
from bridge.outbox import Outbox
from bridge.timing import RecentRate
from bridge.topics import FALL_HORIZON, KEYPOINTS


class Seer:
    """Publishes keypoints of a swaying person, `rate_hz` times a second."""

    def __init__(self, context: NodeContext) -> None:
        self._period_s = 1.0 / float(context.options["rate_hz"])
        self._outbox = Outbox(context.transport, KEYPOINTS)
        self._rate = RecentRate()

    @property
    def period_s(self) -> float | None:
        return self._period_s

    def step(self, now_ns: int) -> None:
        sway = np.sin(now_ns * 1e-9 * 11.0 + np.arange(24.0)).reshape(12, 2)
        self._outbox.send(
            Keypoints(
                stamp_ns=now_ns,
                position_px=160.0 + 20.0 * sway,
                confidence=np.ones(12),
                status=np.zeros(12, dtype=np.uint8),
                body_length_px=90.0,
                image_width=320,
                image_height=240,
            )
        )
        self._rate.note(now_ns)

    def wait(self) -> None:
        pass

    def status(self, now_ns: int) -> NodeStatus:
        values = {"rate_hz": f"{self._rate.rate_hz(now_ns):.1f}", "sent": str(self._outbox.sent)}
        return NodeStatus(stamp_ns=now_ns, role="perception", level=0, summary="stand-in", values=values)

    def finished(self) -> bool:
        return False

    def close(self) -> None:
        self._outbox.close()


class Foreseer:
    """Answers every keypoints message with a horizon that foresees steady walking."""

    period_s: float | None = None

    def __init__(self, context: NodeContext) -> None:
        stuck_s = context.config.inputs.stuck_after_s
        self._inbox = Inbox[Keypoints](context.transport, KEYPOINTS, depth=64, stuck_after_s=stuck_s)
        self._outbox = Outbox(context.transport, FALL_HORIZON)
        self._rate = RecentRate()

    def step(self, now_ns: int) -> None:
        for message in self._inbox.drain(now_ns):
            self._outbox.send(horizon(message))
            self._rate.note(now_ns)

    def wait(self) -> None:
        self._inbox.wait(0.05)

    def status(self, now_ns: int) -> NodeStatus:
        values = {"rate_hz": f"{self._rate.rate_hz(now_ns):.1f}", "sent": str(self._outbox.sent)}
        return NodeStatus(stamp_ns=now_ns, role="anticipation", level=0, summary="stand-in", values=values)

    def finished(self) -> bool:
        return False

    def close(self) -> None:
        self._inbox.close()
        self._outbox.close()


def horizon(message: Keypoints) -> FallHorizon:
    """Return a horizon that rests on `message` and differs from the one before."""
    return FallHorizon(
        stamp_ns=message.stamp_ns,
        probabilities=np.tile([0.95, 0.04, 0.01], (STEPS, 1)),
        distance=4.0 + 1e-3 * message.position_px.ravel()[:STEPS],
        distance_rate=np.zeros(STEPS),
        time_to_boundary=np.full(STEPS, np.inf),
        centre_distance=np.ones((STEPS, 3)),
        plane=np.ones((STEPS, 2)),
        forecast_px=np.broadcast_to(message.position_px, (STEPS, 12, 2)),
        quality=1.0,
    )


def create(context: NodeContext) -> Node:
    """Return the stand-in for the role that option `role` names."""
    return Seer(context) if context.options["role"] == "perception" else Foreseer(context)


if __name__ == "__main__":
    role = next(word.removeprefix("role=") for word in sys.argv if word.startswith("role="))
    raise SystemExit(main(role, create))
