"""Sources and estimators that users copy: what they give is where the pinhole says it is."""

from __future__ import annotations

import http.server
import logging
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples_running import PATIENCE_S, REPO, Running

from bridge.clock import NS, Clock, ManualClock, SystemClock
from bridge.config.load import load_config
from bridge.config.perception import SourceConfig
from bridge.errors import SourceError
from bridge.inbox import Inbox
from bridge.messages import Keypoints, KeypointStatus
from bridge.node import NodeContext
from bridge.plugin import load_module
from bridge.topics import KEYPOINTS
from bridge.transport.memory import MemoryHub
from perception.extras import load_opencv
from perception.node import create
from perception.skeleton import L_HIP, L_SHOULDER, R_SHOULDER
from perception.sources.open import open_source

DEPTH, TWO, MARKERS = (
    str(REPO / "examples" / f"{name}.py") for name in ("depth_camera", "two_cameras", "own_estimator")
)


def keypoints(count: int, clock: Clock, **options: str) -> list[Keypoints]:
    """Return the first `count` messages that perception publishes."""
    hub = MemoryHub(clock)
    inbox: Inbox[Keypoints] = Inbox(hub.transport(), KEYPOINTS, depth=100)
    node = create(NodeContext(load_config(None), hub.transport(), clock, logging.getLogger("test"), options))
    end_s, received = time.monotonic() + PATIENCE_S, list[Keypoints]()
    while len(received) < count and not node.finished():
        assert time.monotonic() < end_s
        node.step(clock.now_ns())
        received += inbox.drain(clock.now_ns())
        node.wait()
    node.close()
    return received


def test_the_pinhole() -> None:
    lens = load_module(DEPTH).Pinhole(500.0, 640, 480)
    points = np.tile([0.0, 0.0, 2.0, 0.8], (12, 1))
    points[1] = [0.4, -0.2, 2.0, 0.7]
    points[2, 2] = -2.0  # behind the lens
    points[3, 2] = 0.0
    points[4, 0] = np.nan
    seen = lens.project(points)
    assert np.array_equal(seen[0], [320.0, 240.0, 0.8])
    assert seen[1] == pytest.approx([420.0, 190.0, 0.7])
    assert np.isnan(seen[[2, 3, 4], 0]).all()
    assert (seen[[2, 3, 4], 2] == 0.0).all()


def test_a_lens_that_is_none_is_said() -> None:
    with pytest.raises(SourceError, match="could not convert string to float: 'wide'"):
        open_source(f"{DEPTH}:frames", SourceConfig(), SystemClock(), {"focal_px": "wide"})


@pytest.mark.processes
def test_a_depth_camera_under_surefoot_up(tmp_path: Path) -> None:
    options = ("--source", "examples/depth_camera.py:frames", "--set", "launch.options.perception.focal_px=500")
    with Running(tmp_path, "perception", "test", *options) as running:
        inbox: Inbox[Keypoints] = Inbox(running.wire, KEYPOINTS, depth=100)
        seen: list[Keypoints] = []

        def enough(now_ns: int) -> bool:
            seen.extend(message for message in inbox.drain(now_ns) if message.valid)
            return len(seen) > 15

        running.until(enough, "valid keypoints")
        assert running.stop() == 0, running.said()
    message = seen[-1]
    assert (message.image_width, message.image_height, message.people) == (640, 480, 1)
    assert (message.status == KeypointStatus.MEASURED).all()
    shoulders = message.position_px[L_SHOULDER] - message.position_px[R_SHOULDER]
    assert shoulders == pytest.approx([500 * 0.36 / 2.5, 0.0], abs=0.5)
    assert message.position_px[L_HIP, 1] == pytest.approx(240.0, abs=0.5)


@pytest.fixture
def two() -> Any:
    return load_module(TWO)


def test_the_second_camera_stands_where_it_is_said_to(two: Any) -> None:
    """What lies 2.5 m before the second camera lies 2.5 m before the first."""
    before = np.tile([0.0, 0.1, 2.5, 0.9], (12, 1))
    assert two.into_first(before)[0] == pytest.approx([0.0, 0.1, 2.5, 0.9])
    assert np.linalg.det(two.SECOND_IN_FIRST[:3, :3]) == pytest.approx(1.0)


def test_joined_points_are_weighted_and_a_quarrel_is_decided(two: Any) -> None:
    one, other = (np.tile([0.0, 0.0, 2.0, 0.6], (12, 1)) for _ in range(2))
    other[:, 3] = 0.2
    other[0, 0] = 0.08  # a small difference: the mean, weighted 3 to 1
    other[1, 0] = 0.50  # a large one: the surer camera
    one[2] = np.nan  # seen by the other alone
    other[3] = np.nan
    one[4] = other[4] = np.nan
    joined = two.join(one, other)
    assert joined[:4, 0] == pytest.approx([0.02, 0.0, 0.0, 0.0])
    assert joined[:4, 3] == pytest.approx([0.6, 0.6, 0.2, 0.6])
    assert np.isnan(joined[4, :3]).all()
    assert joined[5] == pytest.approx([0.0, 0.0, 2.0, 0.6])


def test_two_cameras_see_what_one_sees(two: Any) -> None:
    (message, *_) = keypoints(1, SystemClock(), source=f"{TWO}:frames")
    shoulders = message.position_px[L_SHOULDER] - message.position_px[R_SHOULDER]
    assert shoulders == pytest.approx([420 * 0.36 / 2.5, 0.0], abs=0.5)


def test_markers_in_a_picture_are_keypoints(tmp_path: Path) -> None:
    cv2 = load_opencv("the test", "video")
    colours = load_module(MARKERS).COLOURS
    image = np.zeros((240, 320, 3), dtype=np.uint8)
    places = [(100 + 20 * k, 60 + 10 * k) for k in range(12)]
    for (x, y), colour in list(zip(places, colours.tolist(), strict=True))[:11]:  # the last is hidden
        cv2.rectangle(image, (x - 2, y - 2), (x + 2, y + 2), colour[::-1], thickness=-1)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), image)
    messages = keypoints(3, ManualClock(NS), source=str(tmp_path), estimator=f"{MARKERS}:Markers")
    assert messages[-1].position_px[:11] == pytest.approx(np.array(places[:11]), abs=1e-6)
    assert messages[-1].status[11] == KeypointStatus.LOST
    assert messages[-1].confidence[0] == 1.0


class Stream(http.server.BaseHTTPRequestHandler):
    """A network camera: one JPEG after the other, as such cameras send them."""

    protocol_version = "HTTP/1.1"
    picture = b""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        try:
            for _ in range(2000):
                head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(self.picture)}\r\n\r\n"
                self.wfile.write(head.encode() + self.picture + b"\r\n")
                time.sleep(0.01)
        except OSError:
            self.close_connection = True  # nobody looks any more

    def log_message(self, *arguments: object) -> None: ...


@pytest.fixture
def stream() -> Iterator[str]:
    cv2 = load_opencv("the test", "video")
    image = np.full((48, 64, 3), 200, dtype=np.uint8)
    Stream.picture = cv2.imencode(".jpg", image)[1].tobytes()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Stream)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/camera.mjpg"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_network_stream_is_a_camera(stream: str) -> None:
    clock = SystemClock()
    source = open_source(stream, SourceConfig(), clock)
    try:
        stamps = []
        end_s = time.monotonic() + PATIENCE_S
        while len(stamps) < 3:
            assert time.monotonic() < end_s
            source.wait(clock)
            if (frame := source.next(clock.now_ns())) is not None:
                assert frame.image is not None
                assert frame.image.shape == (48, 64, 3)
                assert np.abs(frame.image.astype(int) - 200).max() < 5
                stamps.append(frame.stamp_ns)
        assert stamps == sorted(set(stamps))
    finally:
        source.close()
