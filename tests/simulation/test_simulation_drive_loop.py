"""Controller and drive closing the loop over the wire, in simulated time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bridge.config.inputs import InputsConfig
from bridge.config.surefoot import SurefootConfig
from bridge.inbox import Inbox
from bridge.lockstep import LockStep
from bridge.messages import STEPS, FallHorizon, GaitState, SupportCommand
from bridge.outbox import Outbox
from bridge.topics import FALL_HORIZON, SUPPORT_COMMAND

NS = 1_000_000_000
START_NS = 1_000 * NS


def stable(stamp_ns: int) -> FallHorizon:
    return FallHorizon(
        stamp_ns=stamp_ns,
        probabilities=np.tile([1.0, 0.0, 0.0], (STEPS, 1)),
        distance=np.full(STEPS, 5.0),
        distance_rate=np.zeros(STEPS),
        time_to_boundary=np.full(STEPS, np.inf),
        centre_distance=np.zeros((STEPS, 3)),
        plane=np.zeros((STEPS, 2)),
        forecast_px=np.zeros((STEPS, 12, 2)),
        quality=1.0,
    )


class Loop:
    """Controller (logging mock) and drive; a horizon that says 'stable' comes 30 times a second until it is cut."""

    def __init__(self) -> None:
        self.system = LockStep(
            SurefootConfig(inputs=InputsConfig(stuck_after_s=0.0)),  # the horizon never changes
            {
                "drive": ("simulation.drive.node", {"script": "fall", "event_s": "2.0", "fall_hold_s": "1.0"}),
                "controller": ("controller.node", {"controller": "log"}),
            },
            START_NS,
        )
        wire = self.system.hub.transport()
        self.horizons = Outbox(wire, FALL_HORIZON)
        self.commands: Inbox[SupportCommand] = Inbox(wire, SUPPORT_COMMAND, max_age_s=1.0)
        self.frame = 0

    def run(self, span_s: float, *, see: bool = True) -> list[SupportCommand]:
        sent = []
        for _ in range(round(span_s * 30)):
            now_ns = START_NS + round(self.frame * NS / 30)
            self.system.advance_to(now_ns)
            if see:
                self.horizons.send(stable(now_ns))
            self.system.settle()
            command = self.commands.read(self.system.clock.now_ns()).message
            assert command is not None
            sent.append(command)
            self.frame += 1
        return sent


@pytest.fixture
def loop() -> Iterator[Loop]:
    loop = Loop()
    yield loop
    loop.system.close()


def test_a_fall_into_the_harness_is_arrested_without_vision_and_released_afterwards(loop: Loop) -> None:
    sent = loop.run(9.0)
    states = [c.state for c in sent]
    passed = [s for k, s in enumerate(states) if k == 0 or s is not states[k - 1]]
    assert passed == [
        GaitState.DISARMED,
        GaitState.FOLLOW,
        GaitState.ARREST,
        GaitState.RECOVER,
        GaitState.FOLLOW,
    ]
    arrest = next(c for c in sent if c.state is GaitState.ARREST)
    assert arrest.reason.startswith("harness load")
    assert max(c.stiffening for c in sent) == 1.0
    assert sent[-1].stiffening == 0.0


def test_vision_lost_while_hanging_in_the_harness_keeps_the_support_stiff(loop: Loop) -> None:
    loop.run(2.6)
    blind = loop.run(1.0, see=False)
    assert blind[-1].state is GaitState.SAFE_STOP
    assert blind[-1].stiffening == 1.0
    assert "support stays stiff" in blind[-1].reason
