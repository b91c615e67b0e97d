"""A codec is ready before the first message: no loop pays for its making."""

from __future__ import annotations

import pytest

from bridge.clock import ManualClock
from bridge.codec import TYPES
from bridge.inbox import Inbox
from bridge.topics import TOPICS, Topic
from bridge.transport.memory import MemoryHub


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.key)
def test_the_reading_end_of_a_topic_has_its_codec(topic: Topic, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TYPES, "cache", {})
    Inbox(MemoryHub(ManualClock()).transport(), topic)
    assert topic.ros_type in TYPES.cache
