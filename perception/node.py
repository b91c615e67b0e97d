"""The perception process: a source of frames in, `Keypoints` on the wire at 30 Hz."""

from __future__ import annotations

import logging
from typing import Final

import numpy as np

from bridge.clock import NS, Clock, nanoseconds
from bridge.config.perception import PerceptionConfig
from bridge.errors import ConfigError, SurefootError
from bridge.inbox import Inbox
from bridge.messages import Floats, Keypoints, KeypointStatus, NodeStatus
from bridge.node import NodeContext, main
from bridge.outbox import Outbox
from bridge.plugin import parse_plugin
from bridge.timing import RecentRate
from bridge.topics import DETECTIONS, KEYPOINTS
from perception.estimators.interface import PoseEstimator, load_estimator
from perception.pipeline import PerceptionPipeline
from perception.sources.frame import Frame, Source
from perception.sources.open import open_source
from perception.sources.picture import parse_crop
from perception.sources.wire import DEPTH, WireSource

_OPTIONS: Final = ("source", "crop", "estimator")
_MOST_FRAMES_A_STEP = 8  # so that a fast source cannot keep the loop from its status and its signals
_STALL_REPEAT_S = 0.1


class PerceptionNode:
    """Takes frames as they come due, finds and cleans the keypoints, and publishes every tick.

    A source that stays silent for `stall_s` is said on the wire, again every 0.1 s,
    by a message that is not valid and names the age of the last frame.
    """

    period_s: float | None = None

    def __init__(
        self,
        source: Source,
        estimator: PoseEstimator | None,
        config: PerceptionConfig,
        outbox: Outbox,
        clock: Clock,
        log: logging.Logger,
    ) -> None:
        self._source = source
        self._estimator = estimator
        self._pipeline = PerceptionPipeline(config)
        self._stall_s = config.stall_s
        self._outbox = outbox
        self._clock = clock
        self._log = log
        self._started_ns: int | None = None
        self._newest: Frame | None = None
        self._rate = RecentRate()
        self._last: Keypoints | None = None
        self._stall_said_ns = 0

    def step(self, now_ns: int) -> None:
        """Publish the ticks of every frame that is due."""
        if self._started_ns is None:
            self._started_ns = now_ns
        for _ in range(_MOST_FRAMES_A_STEP):
            frame = self._source.next(now_ns)
            if frame is None:
                break
            self._take(frame, now_ns)
        self._say_stall(now_ns)

    def wait(self) -> None:
        """Return when a frame may be due."""
        self._source.wait(self._clock)

    def status(self, now_ns: int) -> NodeStatus:
        """Return the rate of ticks and the age of the newest frame."""
        level, summary = 0, "following one person"
        silent_s = self._silent_s(now_ns)
        if self._source.finished:
            summary = f"{self._source.name} is at its end"
        elif silent_s > self._stall_s:
            level, summary = 2, self._stall_reason(silent_s)
        elif self._last is None:
            summary = f"waiting for the first frame of {self._source.name}"
        elif not self._last.valid:
            level, summary = 1, self._last.reason
        values = {
            "rate_hz": f"{self._rate.rate_hz(now_ns):.1f}",
            "age_ms": "" if self._newest is None else f"{silent_s * 1e3:.0f}",
            "source": self._source.name,
            "sent": str(self._outbox.sent),
        }
        if self._last is not None:
            values["people"] = str(self._last.people)
            values["lost_keypoints"] = str(int(np.count_nonzero(self._last.status == KeypointStatus.LOST)))
        return NodeStatus(stamp_ns=now_ns, role="perception", level=level, summary=summary, values=values)

    def finished(self) -> bool:
        """Whether the source is at its end."""
        return self._source.finished

    def close(self) -> None:
        """Release source and wire."""
        self._source.close()
        self._outbox.close()

    def _take(self, frame: Frame, now_ns: int) -> None:
        people: list[Floats] = list(frame.people)
        if frame.image is not None and self._estimator is not None:
            people = self._estimator.estimate(frame.image)
        self._newest = frame
        for message in self._pipeline.push(people, frame.stamp_ns, (frame.width, frame.height)):
            self._outbox.send(message)
            self._tell_change(message)
            self._last = message
            self._rate.note(now_ns)

    def _tell_change(self, message: Keypoints) -> None:
        """Log when the person is found and lost, not every message."""
        if self._last is None or message.valid != self._last.valid:
            self._log.info("%s", "following one person" if message.valid else message.reason)

    def _silent_s(self, now_ns: int) -> float:
        since_ns = self._started_ns if self._newest is None else self._newest.stamp_ns
        return 0.0 if since_ns is None else (now_ns - since_ns) / NS

    def _stall_reason(self, silent_s: float) -> str:
        return f"no frame from {self._source.name} for {silent_s:.1f} s"

    def _say_stall(self, now_ns: int) -> None:
        silent_s = self._silent_s(now_ns)
        if self._source.finished or silent_s <= self._stall_s:
            return
        if now_ns - self._stall_said_ns < nanoseconds(_STALL_REPEAT_S):
            return
        self._stall_said_ns = now_ns
        message = Keypoints(
            stamp_ns=now_ns if self._newest is None else self._newest.stamp_ns,
            position_px=np.full((12, 2), np.nan),
            confidence=np.zeros(12),
            status=np.full(12, KeypointStatus.LOST, dtype=np.uint8),
            body_length_px=float("nan"),
            image_width=0 if self._newest is None else self._newest.width,
            image_height=0 if self._newest is None else self._newest.height,
            valid=False,
            reason=self._stall_reason(silent_s),
            people=0,
        )
        self._outbox.send(message)
        self._tell_change(message)
        self._last = message


def create(context: NodeContext) -> PerceptionNode:
    """Build the node; the options `source`, `crop` and `estimator` win over the config.

    Raises:
        ConfigError: an option that nobody reads, or code of one's own that is not there.
        SourceError: source, crop or estimator cannot be used; one line says why.
        MissingExtraError: an optional package is not installed.
    """
    config = context.config.perception
    source_config = config.source
    if context.options.get("crop"):
        source_config = source_config.model_copy(update={"crop_px": parse_crop(context.options["crop"])})
    name = context.options.get("estimator") or config.estimator
    uri = context.options.get("source") or source_config.uri
    _require_known(context, uri, name)
    source: Source = (
        WireSource(Inbox(context.transport, DETECTIONS, depth=DEPTH))
        if uri == "wire"
        else open_source(uri, source_config, context.clock, context.options)
    )
    try:
        estimator = load_estimator(name, config, context.options) if source.gives_images else None
    except SurefootError:
        source.close()
        raise
    return PerceptionNode(source, estimator, config, Outbox(context.transport, KEYPOINTS), context.clock, context.log)


def _require_known(context: NodeContext, *named: str) -> None:
    """Raise unless every option is known; where code of one's own is `named`, it is the one to know."""
    unknown = [option for option in context.options if option not in _OPTIONS]
    if unknown and not any(parse_plugin(name) for name in named):
        raise ConfigError(f"perception option {unknown[0]}: known: {', '.join(_OPTIONS)}")


if __name__ == "__main__":
    raise SystemExit(main("perception", create))
