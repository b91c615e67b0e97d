"""The writing end of a topic."""

from __future__ import annotations

from bridge.codec import encode
from bridge.messages import Message
from bridge.topics import Topic
from bridge.transport.interface import Transport


class Outbox:
    """Numbers, encodes and sends the messages of one topic."""

    def __init__(self, transport: Transport, topic: Topic) -> None:
        self._topic = topic
        self._publisher = transport.publisher(topic)
        self._sequence = 0

    @property
    def sent(self) -> int:
        """How many messages were sent."""
        return self._sequence

    def send(self, message: Message) -> None:
        """Send `message` under the next sequence number."""
        self._publisher.put(encode(self._topic, message, self._sequence), message.stamp_ns)
        self._sequence += 1

    def close(self) -> None:
        """Stop publishing."""
        self._publisher.close()
