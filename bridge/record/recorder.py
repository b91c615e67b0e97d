"""Listening to the wire and keeping what is said, without ever holding it up."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Sequence
from typing import Final

from bridge.record.writer import BagWriter, RecordingError
from bridge.topics import Topic
from bridge.transport.interface import Handle, Sample, Transport

FLUSH_S: Final = 0.5  # a recording that is killed loses at most about this long
QUEUE_BYTES: Final = 32 << 20  # about 100 s of everything the system says, should the disk stall
GATHER_S: Final = 0.05  # the writer wakes this often, not for every message
OVERHEAD_BYTES: Final = 256  # of one waiting sample, beside its payload


class Recorder:
    """Writes every sample of `topics` from a thread of its own.

    The transport's callback only puts the sample in a queue that is bounded in bytes; what
    arrives while it is full is dropped and counted. The first failure of the disk ends the
    recording and is kept in `failure`; the wire notices nothing.
    """

    def __init__(
        self,
        transport: Transport,
        topics: Sequence[Topic],
        writer: BagWriter,
        flush_s: float = FLUSH_S,
        queue_bytes: int = QUEUE_BYTES,
    ) -> None:
        self.writer = writer
        self.failure: RecordingError | None = None
        self.received: Counter[str] = Counter()  # by key
        self.dropped: Counter[str] = Counter()  # by key
        self._flush_s, self._queue_bytes = flush_s, queue_bytes
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Topic, Sample]] = deque()
        self._waiting_bytes = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._write, name="recorder", daemon=True)
        self._handles: list[Handle] = [
            transport.subscribe(topic, lambda sample, topic=topic: self._store(topic, sample))  # type: ignore[misc]
            for topic in topics
        ]
        self._thread.start()

    def close(self) -> None:
        """Stop listening, write what is waiting, and finish the file.

        Raises:
            RecordingError: writing failed, now or before; everything up to then is kept.
        """
        for handle in self._handles:
            handle.close()
        self._stop.set()
        self._thread.join()
        if self.failure is None:
            self.writer.finish()
        else:
            raise self.failure

    def _store(self, topic: Topic, sample: Sample) -> None:
        size = len(sample.payload) + OVERHEAD_BYTES
        with self._lock:
            self.received[topic.key] += 1
            if self.failure is not None or self._waiting_bytes + size > self._queue_bytes:
                self.dropped[topic.key] += 1
                return
            self._waiting.append((topic, sample))
            self._waiting_bytes += size

    def _take(self) -> deque[tuple[Topic, Sample]]:
        with self._lock:
            taken, self._waiting, self._waiting_bytes = self._waiting, deque(), 0
        return taken

    def _write(self) -> None:
        flush_due_s = time.monotonic() + self._flush_s
        try:
            while True:
                ending = self._stop.is_set()  # asked before taking, so that nothing is left behind
                for topic, sample in self._take():
                    self.writer.write(topic, sample)
                now_s = time.monotonic()
                if now_s >= flush_due_s:
                    self.writer.flush()
                    flush_due_s = now_s + self._flush_s
                if ending:
                    return
                self._stop.wait(min(GATHER_S, self._flush_s))
        except RecordingError as error:
            with self._lock:
                self.failure = error
                self._waiting.clear()
