"""The whole scene: every sample that was heard finds its panels; what is silent or invalid leaves them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from numpy.typing import NDArray

from bridge.clock import NS, nanoseconds
from bridge.codec import decode
from bridge.config.surefoot import SurefootConfig
from bridge.errors import InvalidMessage
from bridge.messages import FallHorizon, Keypoints, Message, NodeStatus, Odometry, SupportCommand, Wrench
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, WRENCH, Topic
from bridge.transport.interface import Sample
from bridge.view.body import Body
from bridge.view.canvas import Canvas, Moment
from bridge.view.control import ControlPanel
from bridge.view.geometry import Plane
from bridge.view.health import HealthPanel
from bridge.view.horizon import HorizonPanel
from bridge.view.plane import PlanePanel
from bridge.view.video import Video
from bridge.view.walker import WalkerPanel

SHOWN: Final = (KEYPOINTS, FALL_HORIZON, WRENCH, ODOMETRY, SUPPORT_COMMAND, DIAGNOSTICS)  # cmd_vel repeats a command


class Scene:
    """Draws samples in the order in which they arrived.

    Nothing old is shown as if it were new: a stream that is silent for longer than its topic
    allows, or whose message must not be used, is taken off its panels, and the events say why.
    """

    def __init__(
        self,
        canvas: Canvas,
        config: SurefootConfig,
        plane: Plane,
        links: NDArray[Any],
        video: Video | None = None,
    ) -> None:
        self._canvas, self._video = canvas, video
        self._body = Body(canvas, links)
        self._plane = PlanePanel(canvas, plane)
        self._horizon = HorizonPanel(canvas, config.intervention)
        self._control = ControlPanel(canvas)
        self._walker = WalkerPanel(canvas, config.walker)
        self._health = HealthPanel(canvas)
        self._heard: dict[str, Moment] = {}  # streams that are on their panels -> their last message
        self.shown = 0  # samples that decoded
        self.image_size: tuple[int, int] | None = None  # of the newest keypoints [px]

    def hear(self, topic: Topic, sample: Sample) -> None:
        """Draw one sample."""
        arrival_ns = sample.arrival_ns
        try:
            message: Any = decode(topic, sample.payload, max(sample.sequence, 0))
        except InvalidMessage as error:
            self._canvas.at(Moment(arrival_ns, arrival_ns))
            self._health.say(topic.key, f"refused: {error}", "ERROR")
            return
        self.shown += 1
        self.look(arrival_ns)
        moment = Moment(message.stamp_ns, arrival_ns)
        self._canvas.at(moment)
        if topic != DIAGNOSTICS:
            self._health.arrived(topic, (arrival_ns - message.stamp_ns) / NS)
        if isinstance(message, Keypoints):
            self.image_size = message.image_width, message.image_height
            if self._video is not None:
                self._video.show(self._canvas, message, sample)
                self._canvas.at(moment)
        try:
            message.check()
        except InvalidMessage as error:
            self._drop(topic, message)
            self._health.say(topic.key, str(error), "WARN")
            return
        self._health.say(topic.key, "", "INFO")
        if topic != DIAGNOSTICS:  # every role has its own silence there
            self._heard[topic.key] = moment
        self._draw(message, arrival_ns)

    def look(self, now_ns: int) -> None:
        """Take away what is older than its topic allows at `now_ns`."""
        for topic in SHOWN:
            last = self._heard.get(topic.key)
            limit_ns = nanoseconds(topic.max_age_s)
            if last is None or now_ns - last.stamp_ns <= limit_ns or now_ns - last.arrival_ns <= limit_ns:
                continue
            self._canvas.at(Moment(last.stamp_ns + limit_ns, last.arrival_ns + limit_ns))
            self._drop(topic, None)
            text = f"{topic.key} is silent: nothing for {topic.max_age_s * 1e3:.0f} ms"
            self._health.say(topic.key, text, "ERROR")
        self._health.silent(now_ns)

    def alive(self, role: str, alive: bool, now_ns: int) -> None:
        """Show that a process has come or gone."""
        self._canvas.at(Moment(now_ns, now_ns))
        self._health.alive(role, alive)

    def _draw(self, message: Message, arrival_ns: int) -> None:
        match message:
            case Keypoints():
                self._body.keypoints(message)
            case FallHorizon():
                self._body.forecast(message)
                self._horizon.horizon(message)
                news = self._plane.horizon(message)
                if news:
                    self._health.say("plane", news, "WARN")
            case SupportCommand():
                self._control.command(message)
                text = f"{message.state}: {message.reason}" if message.reason else message.state.value
                self._health.say("state", text, "INFO" if message.valid else "WARN")
            case Odometry():
                self._control.odometry(message)
                self._walker.odometry(message)
            case Wrench():
                self._control.wrench(message)
                self._walker.wrench(message)
            case NodeStatus():
                self._health.status(message, arrival_ns)

    def _drop(self, topic: Topic, message: Message | None) -> None:
        """Take a stream off its panels."""
        self._heard.pop(topic.key, None)
        gone: dict[str, tuple[Callable[[], None], ...]] = {
            KEYPOINTS.key: (self._body.no_person,),
            FALL_HORIZON.key: (self._body.no_forecast, self._plane.nothing),
            SUPPORT_COMMAND.key: (self._control.no_command,),
            ODOMETRY.key: (self._control.no_odometry, self._walker.no_odometry),
            WRENCH.key: (self._control.no_wrench, self._walker.no_wrench),
        }
        for take_away in gone.get(topic.key, ()):
            take_away()
        if topic == FALL_HORIZON:
            quality = message.quality if isinstance(message, FallHorizon) else float("nan")
            self._horizon.nothing(quality)
