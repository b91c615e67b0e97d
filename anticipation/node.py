"""The anticipation process: `Keypoints` in, `FallHorizon` out, one for every tick."""

from __future__ import annotations

import logging
from collections import deque

import numpy as np
import torch

from anticipation.motion import WINDOW
from anticipation.predictor import Predictor, invalid_horizon
from bridge.clock import NS, Clock, nanoseconds
from bridge.inbox import Inbox
from bridge.messages import FallHorizon, Keypoints, NodeStatus
from bridge.node import NodeContext, main
from bridge.outbox import Outbox
from bridge.timing import RecentRate
from bridge.topics import FALL_HORIZON, KEYPOINTS

_WAIT_S = 0.05
_REPEAT_S = 0.1  # how often a fault that lasts is said again


class AnticipationNode:
    """Follows the keypoints tick by tick and publishes a horizon for the newest.

    Without usable keypoints it publishes horizons that are not valid and say why, at once and then
    every 0.1 s; no horizon is ever sent twice.
    """

    period_s: float | None = None

    def __init__(
        self, predictor: Predictor, inbox: Inbox[Keypoints], outbox: Outbox, clock: Clock, log: logging.Logger
    ) -> None:
        self._predictor = predictor
        self._inbox = inbox
        self._outbox = outbox
        self._clock = clock
        self._log = log
        self._stamp_ns: int | None = None  # of the newest keypoints
        self._newest: FallHorizon | None = None
        self._complained_ns: int | None = None  # since the last keypoints
        self._rate = RecentRate()
        self._took_ms: deque[float] = deque(maxlen=256)

    def step(self, now_ns: int) -> None:
        """Take in every new tick and publish the horizon of the newest, or why there is none."""
        started_ns = self._clock.now_ns()
        messages = self._inbox.drain(now_ns)
        if not messages:
            reading = self._inbox.read(now_ns)
            if not reading.fresh or reading.message is None:  # fresh: it came just after the drain
                self._complain(reading.fault, now_ns)
                return
            messages = [reading.message]
        for message in messages:
            self._predictor.push(message)
        self._publish(self._horizon(messages[-1].stamp_ns, now_ns))
        self._complained_ns = None
        self._rate.note(now_ns)
        self._took_ms.append((self._clock.now_ns() - started_ns) / 1e6)

    def wait(self) -> None:
        """Return when keypoints have come, at the latest after 50 ms."""
        self._inbox.wait(_WAIT_S)

    def status(self, now_ns: int) -> NodeStatus:
        """Return the rate of horizons, the time one takes, and the age of the keypoints."""
        newest = self._newest
        level, summary = 1, "waiting for keypoints"
        if newest is not None and newest.valid:
            level, summary = 0, "foreseeing"
        elif newest is not None:
            level, summary = (2 if self._complained_ns is not None else 1), newest.reason
        if rival := self._inbox.rival(now_ns):
            level, summary = max(level, 1), f"{summary} ({rival})"
        age_ms = "" if self._stamp_ns is None else f"{(now_ns - self._stamp_ns) / 1e6:.0f}"
        values = {
            "rate_hz": f"{self._rate.rate_hz(now_ns):.1f}",
            "keypoints_age_ms": age_ms,
            "inference_p99_ms": f"{np.percentile(self._took_ms, 99):.2f}" if self._took_ms else "",
            "quality": "" if newest is None else f"{newest.quality:.2f}",
            "sent": str(self._outbox.sent),
        }
        return NodeStatus(stamp_ns=now_ns, role="anticipation", level=level, summary=summary, values=values)

    def finished(self) -> bool:
        """Never: the keypoints may come back."""
        return False

    def close(self) -> None:
        """Leave the wire."""
        self._inbox.close()
        self._outbox.close()

    def _horizon(self, stamp_ns: int, now_ns: int) -> FallHorizon:
        self._stamp_ns = stamp_ns
        age_s = (now_ns - stamp_ns) / NS
        if age_s > self._inbox.max_age_s:
            limit_ms = self._inbox.max_age_s * 1e3
            return invalid_horizon(stamp_ns, f"keypoints are {age_s * 1e3:.0f} ms old, limit {limit_ms:.0f}")
        horizon = self._predictor.predict()
        if horizon is None:
            return invalid_horizon(stamp_ns, f"the window holds {self._predictor.frames} of {WINDOW} ticks")
        return horizon

    def _complain(self, fault: str, now_ns: int) -> None:
        """Say at once that the keypoints have become unusable, and again every 0.1 s while they are."""
        repeated = self._complained_ns is not None and now_ns - self._complained_ns < nanoseconds(_REPEAT_S)
        if fault and not repeated:
            self._complained_ns = now_ns
            self._publish(invalid_horizon(now_ns if self._stamp_ns is None else self._stamp_ns, fault))

    def _publish(self, horizon: FallHorizon) -> None:
        if self._newest is None or horizon.valid != self._newest.valid:
            self._log.info("%s", "foreseeing" if horizon.valid else horizon.reason)
        self._newest = horizon
        self._outbox.send(horizon)


def create(context: NodeContext) -> AnticipationNode:
    """Load the networks and run them once, then listen.

    Raises:
        CheckpointError: the checkpoint is missing or damaged.
    """
    config = context.config.anticipation
    torch.set_num_threads(config.threads)
    predictor = Predictor.from_config(config)
    predictor.warm_up()
    stuck_after_s = context.config.inputs.stuck_after_s
    inbox = Inbox[Keypoints](context.transport, KEYPOINTS, depth=WINDOW, stuck_after_s=stuck_after_s)
    return AnticipationNode(predictor, inbox, Outbox(context.transport, FALL_HORIZON), context.clock, context.log)


if __name__ == "__main__":
    raise SystemExit(main("anticipation", create))
