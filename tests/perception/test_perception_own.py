"""Sources and estimators of one's own: a generator in a file is a camera, and what is wrong with it is said."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.clock import NS, ManualClock
from bridge.config.load import load_config
from bridge.config.perception import SourceConfig
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SourceError, SurefootError
from bridge.inbox import Inbox
from bridge.messages import Keypoints
from bridge.node import NodeContext
from bridge.topics import KEYPOINTS
from bridge.transport.memory import MemoryHub
from perception.estimators.interface import load_estimator
from perception.node import PerceptionNode, create
from perception.sources.frame import Frame
from perception.sources.live import Live
from perception.sources.open import open_source

Body = Callable[..., Any]
START_NS = 1_000 * NS
MINE = """
import numpy as np
from perception.sources.frame import Frame

def frames(clock, options):
    for k in range(int(options.get("frames", "3"))):
        yield Frame(clock.now_ns() + k, 320, 240, None, (np.ones((12, 3)) * float(options.get("x", "5")),))

def pictures(clock, options):
    yield Frame(clock.now_ns(), 8, 6, np.zeros((6, 8, 3), np.uint8), ())

def nothing(clock, options): return iter(())
def numbers(clock, options): return [1, 2]
def raises(clock, options): raise OSError("no device on USB")
def late(clock, options): yield Frame(12345, 320, 240, None, ())
def no_frame(clock, options): yield 3
def seventeen(clock, options): yield Frame(clock.now_ns(), 320, 240, None, (np.ones((17, 3)),))
def grey(clock, options): yield Frame(clock.now_ns(), 8, 6, np.zeros((6, 8), np.uint8), ())

class Whole:
    name, gives_images, finished = "whole", False, False
    def __init__(self, clock, options): self.closed = False
    def next(self, now_ns): return None
    def wait(self, clock): ...
    def close(self): self.closed = True

class Pose:
    def __init__(self, options): self.people = int(options.get("people", "1"))
    def estimate(self, image_rgb): return [np.full((12, 3), image_rgb.shape[0]) for _ in range(self.people)]

class Coco(Pose):
    def estimate(self, image_rgb): return [np.zeros((17, 3))]

def mute(options): return object()
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "mine.py").write_text(MINE)
    return str(tmp_path / "mine.py")


def open_mine(spec: str, **options: str) -> Any:
    return open_source(spec, SourceConfig(), ManualClock(START_NS), options)


def drain(source: Any) -> list[Frame]:
    frames = []
    while not source.finished:
        source.wait(ManualClock())
        if (frame := source.next(0)) is not None:
            frames.append(frame)
    return frames


def test_a_generator_is_a_source(mine: str) -> None:
    source = open_mine(f"{mine}:frames", x="7")
    assert (source.name, source.gives_images) == (f"{mine}:frames", False)
    frames = drain(source)
    assert frames[-1].stamp_ns == START_NS + 2, "the newest counts"
    assert np.array_equal(frames[-1].people[0], np.full((12, 3), 7.0))
    source.close()


def test_a_source_of_ones_own_may_pace_itself(mine: str) -> None:
    source = open_mine(f"{mine}:Whole")
    assert source.name == "whole"


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("nothing", SourceError, "mine.py:nothing: gives no frame"),
        (
            "numbers",
            SourceError,
            r"gives a list, expected an iterator of frames, or a Source \(it has no name, gives_im",
        ),
        ("raises", SourceError, "source '.*mine.py:raises' fails: OSError: no device on USB"),
        ("late", SourceError, r"the first frame is stamped 1e\+03 s before now, limit 2: stamps are nanoseconds"),
        ("no_frame", SourceError, "mine.py:no_frame: gave a int, expected perception.sources.frame.Frame"),
        ("seventeen", SourceError, r"a person has shape \(17, 3\), expected \(12, 3\)"),
        ("grey", SourceError, r"image is uint8 \(6, 8\), expected uint8 \(6, 8, 3\), RGB"),
        ("farmes", ConfigError, "'farmes' is not there; did you mean 'frames'?"),
    ],
)
def test_a_source_that_cannot_be_used_says_why(mine: str, name: str, error: type[SurefootError], words: str) -> None:
    with pytest.raises(error, match=words) as caught:
        open_mine(f"{mine}:{name}")
    assert "\n" not in str(caught.value)


def test_a_crop_is_not_silently_dropped(mine: str) -> None:
    with pytest.raises(SourceError, match="a crop is not applied to a source of your own"):
        open_source(f"{mine}:frames", SourceConfig(crop_px=(0, 0, 2, 2)), ManualClock(START_NS))


class Hand:
    """A generator in the test's hand."""

    def __init__(self) -> None:
        self.go = threading.Semaphore(0)
        self.closed = threading.Event()
        self.failure: Exception | None = None

    def frames(self) -> Iterator[Frame]:
        try:
            for k in range(1000):
                yield Frame(START_NS + k, 320, 240, None, ())
                self.go.acquire()
                if self.failure is not None:
                    raise self.failure
        finally:
            self.closed.set()


def wait_for(live: Live) -> Frame:
    for _ in range(200):
        live.wait(ManualClock())
        if (frame := live.next(0)) is not None:
            return frame
    raise AssertionError("no frame within 10 s")


def test_closing_closes_the_generator() -> None:
    hand = Hand()
    live = Live("hand", hand.frames(), ManualClock(START_NS))
    assert wait_for(live).stamp_ns == START_NS
    hand.go.release()
    assert wait_for(live).stamp_ns == START_NS + 1
    assert live.next(0) is None, "no frame twice"
    hand.go.release(5)
    live.close()
    assert hand.closed.wait(5.0)


def test_what_a_camera_raises_later_ends_the_process_and_not_the_system() -> None:
    """A SourceError is a refusal, which nobody restarts; a camera that was unplugged is worth another try."""
    hand = Hand()
    live = Live("hand", hand.frames(), ManualClock(START_NS))
    wait_for(live)
    hand.failure = OSError("unplugged")
    hand.go.release()
    with pytest.raises(OSError, match="unplugged"):
        wait_for(live)
    assert not live.finished
    live.close()


def test_an_estimator_of_ones_own(mine: str) -> None:
    estimator = load_estimator(f"{mine}:Pose", SurefootConfig().perception, {"people": "2"})
    people = estimator.estimate(np.zeros((6, 8, 3), np.uint8))
    assert [person.shape for person in people] == [(12, 3), (12, 3)]


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("mute", SourceError, r"gives a object, which has no method estimate\(image_rgb\)"),
        ("Posse", ConfigError, "estimator '.*mine.py:Posse': .*'Posse' is not there; did you mean 'Pose'?"),
        ("frames", SourceError, r"fails: TypeError: frames\(\) missing 1 required"),
    ],
)
def test_an_estimator_that_cannot_be_used_says_why(
    mine: str, name: str, error: type[SurefootError], words: str
) -> None:
    with pytest.raises(error, match=words):
        load_estimator(f"{mine}:{name}", SurefootConfig().perception)


def test_an_estimator_of_another_skeleton_is_told_which(mine: str) -> None:
    estimator = load_estimator(f"{mine}:Coco", SurefootConfig().perception)
    with pytest.raises(SourceError, match=r"shape \(17, 3\), expected \(12, 3\).*pose\[COCO_INDEX\]"):
        estimator.estimate(np.zeros((6, 8, 3), np.uint8))


def perception(options: dict[str, str], *overrides: str) -> tuple[PerceptionNode, Inbox[Keypoints]]:
    clock = ManualClock(START_NS)
    hub = MemoryHub(clock)
    inbox: Inbox[Keypoints] = Inbox(hub.transport(), KEYPOINTS, depth=100)
    config = load_config(None, overrides)
    return create(NodeContext(config, hub.transport(), clock, logging.getLogger("test"), options)), inbox


def test_the_node_runs_both_of_ones_own(mine: str) -> None:
    node, inbox = perception({"source": f"{mine}:pictures"}, f"perception.estimator={mine}:Pose")
    node.step(START_NS)
    (message,) = inbox.drain(START_NS)
    assert (message.image_width, message.image_height, message.people) == (8, 6, 1)
    node.close()


def test_an_option_that_nobody_reads_is_an_error(tmp_path: Path, body: Body) -> None:
    np.savez(tmp_path / "walk.npz", walk=np.array([body() for _ in range(3)]))
    with pytest.raises(ConfigError, match="perception option focal_px: known: source, crop, estimator"):
        perception({"source": f"{tmp_path}/walk.npz:walk", "focal_px": "600"})


@pytest.mark.parametrize("name", ["yolov9", "lab.pose", "pose.py"])
def test_an_estimator_of_no_known_form_is_an_error(name: str) -> None:
    with pytest.raises(ConfigError, match="perception.estimator = .*expected movenet, yolo, or code of your own as"):
        load_config(None, [f"perception.estimator={name}"])
