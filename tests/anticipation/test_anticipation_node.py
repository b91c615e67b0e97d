"""The process: one horizon for each tick, reasons without one, and nothing said twice."""

import logging
from pathlib import Path

import numpy as np
import pytest
from anticipation_nets import PERIOD_NS, STANDING, START_NS, message, nobody, random_checkpoint

from anticipation.checkpoint import save
from anticipation.node import AnticipationNode, create
from bridge.clock import ManualClock
from bridge.config.surefoot import SurefootConfig
from bridge.errors import CheckpointError
from bridge.inbox import Inbox
from bridge.messages import FallHorizon
from bridge.node import NodeContext
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON, KEYPOINTS
from bridge.transport.memory import MemoryHub


class Bench:
    """A node on an in-memory wire with a hand on the clock."""

    def __init__(self, checkpoint: Path) -> None:
        self.clock = ManualClock(START_NS)
        hub = MemoryHub(self.clock)
        still = {"stuck_after_s": 0.0}  # the person of these tests stands like a statue
        config = SurefootConfig(anticipation={"checkpoint": str(checkpoint)}, inputs=still)
        self.node: AnticipationNode = create(
            NodeContext(config, hub.transport(), self.clock, logging.getLogger("test"), {})
        )
        self.keypoints = Outbox(hub.transport(), KEYPOINTS)
        self.horizons = Inbox[FallHorizon](hub.transport(), FALL_HORIZON, max_age_s=float("inf"), depth=64)

    def at(self, tick: float) -> int:
        self.clock.sleep_until(START_NS + round(tick * PERIOD_NS))
        return self.clock.now_ns()

    def step(self, tick: float, *messages) -> list[FallHorizon]:
        now_ns = self.at(tick)
        for item in messages:
            self.keypoints.send(item)
        self.node.step(now_ns)
        return self.horizons.drain(now_ns)

    def walk(self, ticks) -> list[FallHorizon]:
        return [horizon for tick in ticks for horizon in self.step(tick, message(tick))]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "random.safetensors"
    save(random_checkpoint(), path)
    return path


@pytest.fixture
def bench(checkpoint: Path) -> Bench:
    return Bench(checkpoint)


def test_one_horizon_for_each_tick_stamped_with_it(bench):
    horizons = bench.walk(range(20))
    assert [horizon.stamp_ns for horizon in horizons] == [message(tick).stamp_ns for tick in range(20)]
    assert [horizon.valid for horizon in horizons] == [False] * 14 + [True] * 6
    assert horizons[3].reason == "the window holds 4 of 15 ticks"
    assert [horizon.sequence for horizon in horizons] == list(range(20))


def test_a_burst_is_taken_in_whole_and_answered_once(bench):
    bench.walk(range(15))
    (horizon,) = bench.step(18, *(message(tick) for tick in range(15, 19)))
    assert horizon.stamp_ns == message(18).stamp_ns
    assert horizon.valid


def test_nothing_new_means_nothing_said(bench):
    bench.walk(range(20))
    assert bench.step(20) == []
    assert bench.step(21) == []


def test_silence_is_said_at_once_and_then_ten_times_a_second(bench):
    assert bench.walk(range(20))[-1].valid
    said = [(tick, horizon) for tick in np.arange(20, 50, 0.5) for horizon in bench.step(tick)]
    first = said[0][0]
    assert first * PERIOD_NS == pytest.approx(19 * PERIOD_NS + 150_000_000, abs=PERIOD_NS)
    assert len(said) == pytest.approx((50 - first) / 3, abs=1)
    assert all(not horizon.valid and "limit 150" in horizon.reason for _, horizon in said)
    assert {horizon.stamp_ns for _, horizon in said} == {message(19).stamp_ns}


def test_before_the_first_keypoints_it_says_so(bench):
    (horizon,) = bench.step(0)
    assert not horizon.valid
    assert horizon.reason == "no keypoints received yet"


def test_keypoints_that_come_too_late_are_not_acted_on(bench):
    bench.walk(range(20))
    (horizon,) = bench.step(28, message(20))
    assert not horizon.valid
    assert horizon.reason == "keypoints are 267 ms old, limit 150"


def test_invalid_keypoints_are_passed_on_with_their_reason(bench):
    bench.walk(range(20))
    (horizon,) = bench.step(20, nobody(20, "nobody in view"))
    assert not horizon.valid
    assert "nobody in view" in horizon.reason
    assert horizon.stamp_ns == message(20).stamp_ns
    (recovered,) = bench.step(21, message(21))
    assert recovered.valid


def test_malformed_keypoints_are_named_and_not_used(bench):
    bench.walk(range(20))
    broken = message(20, status=np.zeros(12), position_px=np.where(np.eye(12, 2) > 0, np.nan, STANDING))
    (horizon,) = bench.step(20, broken)
    assert not horizon.valid
    assert "not finite" in horizon.reason
    assert bench.step(21, message(21))[0].valid


def test_status_tells_rate_age_and_time(bench):
    waiting = bench.node.status(bench.at(0))
    assert waiting.level == 1
    bench.walk(range(40))
    status = bench.node.status(bench.at(40))
    assert status.level == 0
    assert float(status.values["rate_hz"]) == pytest.approx(30, abs=0.1)
    assert float(status.values["keypoints_age_ms"]) == pytest.approx(33, abs=1)
    assert float(status.values["inference_p99_ms"]) >= 0
    bench.step(60)
    stale = bench.node.status(bench.at(60))
    assert stale.level == 2
    assert "limit 150" in stale.summary


def test_it_never_finishes_by_itself_and_closes(bench):
    assert not bench.node.finished()
    bench.node.close()


def test_a_missing_checkpoint_is_one_line(tmp_path):
    with pytest.raises(CheckpointError, match="nothing.safetensors: no such checkpoint"):
        Bench(tmp_path / "nothing.safetensors")
