"""Recorded messages are judged as the inbox judges them live."""

from __future__ import annotations

import numpy as np
import pytest
from controller_tuning_streams import START_NS, watched

from bridge.clock import NS, ManualClock
from bridge.codec import encode
from bridge.inbox import Inbox
from bridge.messages import FallHorizon
from bridge.topics import FALL_HORIZON
from bridge.transport.interface import Sample
from bridge.transport.memory import MemoryHub
from controller.tuning.judging import Judge

BASE = watched(1.0, ()).horizons.message(3)


def sample(
    number: int, at_s: float, stamp_s: float | None = None, source: bytes = b"a" * 16, **changes: object
) -> Sample:
    """A horizon that arrives `at_s` after the start; its values are its own unless they are given."""
    fields = {name: getattr(BASE, name) for name in BASE.__dataclass_fields__}
    distance = BASE.distance + 1e-3 * at_s
    fields |= {
        "stamp_ns": START_NS + round((at_s if stamp_s is None else stamp_s) * NS),
        "distance": distance,
        **changes,
    }
    return Sample(encode(FALL_HORIZON, FallHorizon(**fields), number), number, source, START_NS + round(at_s * NS))


STREAMS = {
    "steady": [sample(n, 0.03 * n) for n in range(8)],
    "invalid, said again under one stamp": [
        sample(0, 0.0), sample(1, 0.03),
        *(sample(n, 0.03 * n, 0.03, valid=False, reason="nobody") for n in range(2, 6)), sample(6, 0.2),
    ],
    "repeated and overtaken": [
        sample(0, 0.0), sample(2, 0.06), sample(1, 0.07, 0.03), sample(2, 0.08, 0.06), sample(3, 0.1),
    ],
    "a rival, then a successor": [
        sample(0, 0.0), sample(0, 0.01, source=b"b" * 16), sample(1, 0.03), sample(1, 0.04, source=b"b" * 16),
        sample(2, 0.5, source=b"b" * 16), sample(3, 0.53, source=b"b" * 16),
    ],
    "started again": [sample(5, 0.0), sample(0, 0.4), sample(1, 0.43)],
    "from the future": [sample(0, 0.0), sample(1, 0.03, 0.04), sample(2, 0.06, 0.2), sample(3, 0.1)],
    "stuck": [sample(n, 0.03 * n, distance=BASE.distance) for n in range(20)],
    "nonsense": [
        sample(0, 0.0), sample(1, 0.03, distance=np.full(16, np.nan)), sample(2, 0.06, quality=7.0), sample(3, 0.1),
        Sample(b"not a message", 4, b"a" * 16, START_NS + 130_000_000), sample(5, 0.16),
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", STREAMS)
def test_what_the_inbox_takes_is_taken(name: str) -> None:
    hub = MemoryHub(ManualClock(START_NS))
    inbox = Inbox[FallHorizon](hub.transport(), FALL_HORIZON, 10.0, stuck_after_s=0.3)
    inbox.max_age_s = FALL_HORIZON.max_age_s  # of a publisher, not of a message
    judge = Judge(FALL_HORIZON, 0.3)
    for one in STREAMS[name]:
        hub.deliver(FALL_HORIZON, one)
        reading = inbox.read(one.arrival_ns)
        judged = judge.judge(one)
        if judged is not None and not judged.fault:
            assert reading.fresh, one
            assert reading.message is not None
            assert reading.message.stamp_ns == judged.message.stamp_ns
        else:
            assert not reading.fresh, one
        if judged is not None and judged.fault:
            assert reading.fault == judged.fault
