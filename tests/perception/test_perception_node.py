"""The perception process on the in-memory wire, with time moved by hand."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.clock import NS, Clock, ManualClock, nanoseconds
from bridge.config.perception import PerceptionConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SourceError
from bridge.inbox import Inbox
from bridge.messages import Keypoints
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import KEYPOINTS
from bridge.transport.memory import MemoryHub
from perception.extras import load_opencv
from perception.node import PerceptionNode, create
from perception.sources.frame import Frame

Floats = NDArray[np.float64]
Body = Callable[..., Floats]
LOG = logging.getLogger("test")


class Bench:
    """One node, one reader, one clock."""

    def __init__(self) -> None:
        self.clock = ManualClock(100 * NS)
        self.hub = MemoryHub(self.clock)
        self.inbox: Inbox[Keypoints] = Inbox(self.hub.transport(), KEYPOINTS, depth=1000)

    def create(self, config: SurefootConfig | None = None, **options: str) -> PerceptionNode:
        return create(NodeContext(config or SurefootConfig(), self.hub.transport(), self.clock, LOG, options))

    def run(self, node: PerceptionNode, seconds: float) -> list[Keypoints]:
        """Turn the node's loop for a while; return what arrived."""
        until_ns = self.clock.now_ns() + nanoseconds(seconds)
        received = []
        while self.clock.now_ns() < until_ns and not node.finished():
            node.step(self.clock.now_ns())
            received += self.inbox.drain(self.clock.now_ns())
            before_ns = self.clock.now_ns()
            node.wait()
            if self.clock.now_ns() == before_ns:
                self.clock.advance(0.005)
        return received


class Feed:
    """A live source in the test's hand."""

    name = "feed"
    gives_images = False
    finished = False

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.closed = False

    def next(self, now_ns: int) -> Frame | None:
        return self.frames.pop(0) if self.frames else None

    def wait(self, clock: Clock) -> None:
        pass

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def clip(tmp_path: Path, body: Body) -> str:
    path = tmp_path / "walk.npz"
    np.savez(path, **{"walk/keypoints": np.array([body(x=100 + k) for k in range(60)]), "walk/fps": 30.0})
    return f"{path}:walk"


def live(bench: Bench, feed: Feed, config: PerceptionConfig | None = None) -> PerceptionNode:
    outbox = Outbox(bench.hub.transport(), KEYPOINTS)
    return PerceptionNode(feed, None, config or PerceptionConfig(), outbox, bench.clock, LOG)


def test_a_keypoint_file_is_played_at_thirty_hertz_to_its_end(clip: str) -> None:
    bench = Bench()
    node = bench.create(source=clip)
    messages = bench.run(node, 10.0)
    assert node.finished()
    assert [message.sequence for message in messages] == list(range(60))
    assert [message.stamp_ns - 100 * NS for message in messages] == [round(k * NS / 30) for k in range(60)]
    assert bench.clock.now_ns() == pytest.approx(100 * NS + 59 * NS / 30, abs=0.05 * NS)
    for message in messages:
        message.check()
    node.close()


def test_the_reader_finds_every_message_fresh(clip: str) -> None:
    bench = Bench()
    node = bench.create(source=clip)
    for _ in range(30):
        node.step(bench.clock.now_ns())
        reading = bench.inbox.read(bench.clock.now_ns())
        assert reading.ok
        assert reading.age_s < 0.034
        bench.clock.advance(0.02)


def test_the_option_wins_over_the_config(clip: str) -> None:
    config = SurefootConfig.model_validate({"perception": {"source": {"uri": "nowhere.npz:walk"}}})
    with pytest.raises(SourceError, match="nowhere.npz: no such keypoint file"):
        Bench().create(config)
    assert not Bench().create(config, source=clip).finished()


def test_no_source_is_said() -> None:
    with pytest.raises(SourceError, match="no source given"):
        Bench().create()


def test_a_bad_crop_or_estimator_is_said(clip: str, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="crop '1,2': expected X,Y,WIDTH,HEIGHT"):
        Bench().create(source=clip, crop="1,2")
    cv2 = load_opencv("the test", "video")
    cv2.imwrite(str(tmp_path / "frame.png"), np.zeros((8, 8, 3), dtype=np.uint8))
    with pytest.raises(SourceError, match="estimator 'openpose': expected one of movenet, yolo"):
        Bench().create(source=str(tmp_path), estimator="openpose")


def test_a_silent_camera_is_said_again_and_again_until_it_comes_back(body: Body) -> None:
    bench, feed = Bench(), Feed()
    config = PerceptionConfig()
    node = live(bench, feed, config)
    for _ in range(30):
        feed.frames.append(Frame(bench.clock.now_ns(), 320, 240, None, (body(),)))
        messages = bench.run(node, 1 / 30)
    assert messages[-1].valid
    assert node.status(bench.clock.now_ns()).level == 0
    last_ns = messages[-1].stamp_ns

    silent = bench.run(node, 1.0)
    assert len(silent) >= 5
    assert silent[0].reason == "no frame from feed for 0.2 s"
    for message in silent:
        assert not message.valid
        assert 0 <= message.stamp_ns - last_ns < NS / 30  # the newest frame, not the newest tick
        assert message.reason.startswith("no frame from feed for ")
    assert "no frame from feed" in bench.inbox.read(bench.clock.now_ns()).fault
    status = node.status(bench.clock.now_ns())
    assert status.level == 2
    assert "no frame from feed" in status.summary
    assert float(status.values["age_ms"]) > 900

    feed.frames.append(Frame(bench.clock.now_ns(), 320, 240, None, (body(),)))
    assert bench.run(node, 1 / 30)[-1].valid
    assert bench.inbox.read(bench.clock.now_ns()).ok


def test_a_camera_that_never_starts_is_said() -> None:
    bench = Bench()
    node = live(bench, Feed())
    messages = bench.run(node, 1.0)
    assert messages
    assert all(not message.valid and "no frame from feed" in message.reason for message in messages)


def test_status_tells_rate_age_and_what_is_wrong(clip: str, body: Body) -> None:
    bench = Bench()
    node = bench.create(source=clip)
    bench.run(node, 1.5)
    status = node.status(bench.clock.now_ns())
    status.check()
    assert (status.role, status.level) == ("perception", 0)
    assert float(status.values["rate_hz"]) == pytest.approx(30.0, abs=0.5)
    assert float(status.values["age_ms"]) < 50
    assert status.values["lost_keypoints"] == "0"

    feed = Feed()
    node = live(bench, feed)
    feed.frames.append(Frame(bench.clock.now_ns(), 320, 240, None, ()))
    node.step(bench.clock.now_ns())
    status = node.status(bench.clock.now_ns())
    assert (status.level, status.summary) == (1, "nobody in view")


def test_closing_releases_the_source() -> None:
    feed = Feed()
    live(Bench(), feed).close()
    assert feed.closed


def test_images_go_through_the_estimator(body: Body) -> None:
    class Estimator:
        def estimate(self, image_rgb: Any) -> list[Floats]:
            return [body(x=float(image_rgb[0, 0, 0]))]

    bench, feed = Bench(), Feed()
    outbox = Outbox(bench.hub.transport(), KEYPOINTS)
    node = PerceptionNode(feed, Estimator(), PerceptionConfig(), outbox, bench.clock, LOG)
    image = np.full((240, 320, 3), 150, dtype=np.uint8)
    feed.frames.append(Frame(bench.clock.now_ns(), 320, 240, image, ()))
    (message,) = bench.run(node, 1 / 30)
    assert message.position_px[[6, 7], 0].mean() == pytest.approx(150.0)
    assert (message.image_width, message.image_height) == (320, 240)


@pytest.mark.data
def test_a_urfd_video_runs_through_movenet(data_dir: Path) -> None:
    pytest.importorskip("ai_edge_litert")
    bench = Bench()
    weights = str(data_dir / "weights" / "movenet_lightning_int8.tflite")
    config = SurefootConfig.model_validate({"perception": {"movenet": {"weights": weights}}})
    video = str(data_dir / "urfd" / "videos" / "fall-16-cam0.mp4")
    node = bench.create(config, source=video, crop="320,0,320,240", estimator="movenet")
    messages = bench.run(node, 10.0)
    assert len(messages) == 55
    assert sum(message.valid for message in messages) > 50
    node.close()
