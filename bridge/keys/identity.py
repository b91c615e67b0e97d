"""Who there is on the wire: the names that stand in certificates."""

from __future__ import annotations

from typing import Final

from bridge.topics import TOPICS

OBSERVER: Final = "observer"  # reads everything, writes nothing: record, view, the screen of `surefoot up`
ROUTER: Final = "router"  # hands on what it was given by those who may say it
PUBLISHERS: Final = tuple(dict.fromkeys(topic.publisher for topic in TOPICS if topic.publisher != "*"))
IDENTITIES: Final = (*PUBLISHERS, OBSERVER, ROUTER)


def identity_of(role: str) -> str:
    """Return the identity under which a process of `role` speaks: its own, or that of an observer."""
    return role if role in IDENTITIES else OBSERVER
