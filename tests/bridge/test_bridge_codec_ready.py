"""A codec is ready before the first message: no loop pays for its making."""

from __future__ import annotations

from typing import Any

import pytest

from bridge.clock import ManualClock
from bridge.codec import TYPES
from bridge.inbox import Inbox
from bridge.outbox import Outbox
from bridge.topics import TOPICS, Topic
from bridge.transport.memory import MemoryHub


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.key)
@pytest.mark.parametrize("end", [Inbox, Outbox])
def test_an_end_of_a_topic_has_its_codec(topic: Topic, end: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TYPES, "cache", {})
    end(MemoryHub(ManualClock()).transport(), topic)
    assert topic.ros_type in TYPES.cache
