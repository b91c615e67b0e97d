from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from bridge.clock import NS
from bridge.config.perception import PerceptionConfig
from bridge.errors import InvalidMessage
from bridge.messages import Keypoints, KeypointStatus
from perception.pipeline import PerceptionPipeline
from perception.skeleton import L_HIP, R_HIP

Floats = NDArray[np.float64]
Body = Callable[..., Floats]
CONFIG = PerceptionConfig()
SIZE = (640, 480)


class Scene:
    """Feeds the pipeline at 30 fps and keeps what it says."""

    def __init__(self, config: PerceptionConfig = CONFIG) -> None:
        self.pipeline = PerceptionPipeline(config)
        self.frame = 0
        self.messages: list[Keypoints] = []

    def show(self, *people: Floats, frames: int = 1) -> list[Keypoints]:
        said = []
        for _ in range(frames):
            said += self.pipeline.push(people, NS + round(self.frame * NS / 30), SIZE)
            self.frame += 1
        self.messages += said
        return said

    @property
    def last(self) -> Keypoints:
        return self.messages[-1]


def at(message: Keypoints, x: float) -> bool:
    return abs(float(np.mean(message.position_px[[L_HIP, R_HIP], 0])) - x) < 3.0


def test_one_person_gives_a_usable_message_for_every_tick(body: Body) -> None:
    scene = Scene()
    messages = scene.show(body(x=300.0), frames=10)
    assert len(messages) == 10
    for message in messages:
        message.check()
        assert (message.image_width, message.image_height) == SIZE
        assert message.people == 1
        assert message.reason == ""
        assert (message.status == KeypointStatus.MEASURED).all()


def test_nobody_in_view_is_said_at_every_tick() -> None:
    scene = Scene()
    for message in scene.show(frames=5):
        assert (message.valid, message.reason, message.people) == (False, "nobody in view", 0)
        with pytest.raises(InvalidMessage, match="nobody in view"):
            message.check()


def test_the_largest_and_surest_person_is_locked_at_start_and_kept(body: Body) -> None:
    scene = Scene()
    near, far, unsure = body(x=150, size=150.0), body(x=400, size=60.0), body(x=550, size=160.0, confidence=0.3)
    scene.show(far, unsure, near)
    assert at(scene.last, 150)
    # somebody larger comes in: the one locked is still the one followed
    for k in range(30):
        scene.show(body(x=500 - 2 * k, size=250.0), body(x=150 + k, size=150.0))
    assert at(scene.last, 179)
    assert scene.last.people == 2


def test_two_people_pass_each_other(body: Body) -> None:
    scene = Scene()
    scene.show(body(x=100, y=150, size=140.0))
    for k in range(120):
        scene.show(body(x=500 - 4 * k, y=250, size=100.0), body(x=100 + 3 * k, y=150, size=140.0))
        assert scene.last.valid
    assert at(scene.last, 100 + 3 * 119)


def test_losing_the_person_is_said_and_not_guessed_over(body: Body) -> None:
    scene = Scene()
    scene.show(body(x=100.0), frames=30)
    lost = scene.show(body(x=500.0), frames=30)  # somebody else
    filled = [message for message in lost if message.valid]
    assert len(filled) <= CONFIG.cleaning.fill_s * 30 + 1
    assert all((message.status == KeypointStatus.FILLED).all() for message in filled)
    assert "followed person lost for 0.4 s" in {message.reason for message in lost}
    assert lost[-1].reason == "followed person lost for 1.0 s"
    assert np.isnan(lost[-1].position_px).all()
    assert lost[-1].people == 1


def test_the_person_is_found_again_where_they_were_left(body: Body) -> None:
    scene = Scene()
    scene.show(body(x=100.0), frames=30)
    scene.show(frames=20)
    assert not scene.last.valid
    scene.show(body(x=500.0), body(x=120.0))
    assert scene.last.valid
    assert at(scene.last, 120)


def test_after_the_relock_time_somebody_else_is_followed_with_their_own_size(body: Body) -> None:
    scene = Scene()
    scene.show(body(x=100.0, size=100.0), frames=60)
    frames = int(CONFIG.tracking.relock_s * 30) + 3
    scene.show(body(x=500.0, size=200.0), frames=frames)
    assert at(scene.last, 500)
    assert scene.last.body_length_px == pytest.approx(200.0, rel=0.05)
    stamps = [message.stamp_ns for message in scene.messages]
    assert np.diff(stamps) == pytest.approx(NS / 30, abs=2)  # the clock of ticks went on


def test_hidden_hips_are_named(body: Body) -> None:
    scene = Scene()
    person = body(x=300.0)
    scene.show(person, frames=10)
    person[[L_HIP, R_HIP]] = np.nan
    scene.show(person, frames=10)
    assert (scene.last.valid, scene.last.reason) == (False, "hips of the followed person lost")
    assert np.isfinite(scene.last.position_px[0]).all()


def test_a_few_stray_keypoints_are_nobody(body: Body) -> None:
    person = body(x=300.0)
    person[CONFIG.tracking.min_keypoints - 1 :] = np.nan
    scene = Scene()
    scene.show(person)
    assert scene.last.people == 0


def test_keypoints_far_outside_the_image_are_none(body: Body) -> None:
    person = body(x=300.0)
    person[3, 0] = 1e7
    person[4, 1] = -np.inf
    scene = Scene()
    scene.show(person, frames=3)
    scene.last.check()
    assert scene.last.status[3] == scene.last.status[4] == KeypointStatus.LOST


def test_ticks_do_not_depend_on_the_frame_rate(body: Body) -> None:
    pipeline = PerceptionPipeline(CONFIG)
    messages = []
    for k in range(61):
        messages += pipeline.push([body(x=300.0)], NS + round(k * NS / 12), SIZE)
    assert len(messages) == 151
    assert all(message.valid for message in messages)
