"""A piece of bad network: a TCP relay that delays, loses packets or connections, or swallows all when told to."""

from __future__ import annotations

import contextlib
import random
import selectors
import socket
import threading
import time
from collections import deque

RETRANSMISSION_S = 0.2  # the shortest after which Linux sends a lost TCP segment again


class Relay:
    """Carries bytes between whoever connects to it and `target`, both ways, from a thread of its own.

    Attributes:
        address: where it listens, such as `127.0.0.2:4711`.
        delay_s: how late every byte arrives.
        loss: share of what is sent that is lost: it comes one retransmission later, and what follows waits for it.
        swallow: while set, nothing is carried and nothing is closed, as when a cable is pulled.
    """

    def __init__(self, target: tuple[str, int], host: str = "127.0.0.1") -> None:
        self._target = target
        self._listener = socket.create_server((host, 0))
        self.address = "{}:{}".format(*self._listener.getsockname())
        self.delay_s, self.loss, self.carried, self.lost = 0.0, 0.0, 0, 0
        self._dice = random.Random(0)
        self.swallow = False
        self._pairs: list[_Pair] = []
        self._cut = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """Break every connection there is; new ones are accepted."""
        self._cut.set()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector, self._listener:
            self._listener.setblocking(False)
            selector.register(self._listener, selectors.EVENT_READ, None)
            while not self._stop.is_set():
                for key, _events in selector.select(0.005):
                    if key.data is None:
                        self._accept(selector)
                    elif not self.swallow:
                        self._read(selector, key.data, key.fileobj)
                if self._cut.is_set():
                    self._cut.clear()
                    self._drop(selector, list(self._pairs))
                if not self.swallow:
                    self._drop(selector, [pair for pair in self._pairs if not pair.send(time.monotonic())])
            self._drop(selector, list(self._pairs))

    def _accept(self, selector: selectors.BaseSelector) -> None:
        near, _address = self._listener.accept()
        if self.swallow:
            near.close()
            return
        try:
            far = socket.create_connection(self._target, timeout=1.0)
        except OSError:
            near.close()
            return
        pair = _Pair(near, far)
        self._pairs.append(pair)
        for end in (near, far):
            end.setblocking(False)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            selector.register(end, selectors.EVENT_READ, pair)

    def _read(self, selector: selectors.BaseSelector, pair: _Pair, end: object) -> None:
        assert isinstance(end, socket.socket)
        try:
            data = end.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(selector, [pair])
            return
        self.carried += len(data)
        due_s = time.monotonic() + self.delay_s
        if self._dice.random() < self.loss:
            due_s += RETRANSMISSION_S
            self.lost += 1
        pair.waiting.append((due_s, pair.other(end), data))

    def _drop(self, selector: selectors.BaseSelector, pairs: list[_Pair]) -> None:
        for pair in pairs:
            if pair not in self._pairs:
                continue
            self._pairs.remove(pair)
            for end in (pair.near, pair.far):
                with contextlib.suppress(KeyError):
                    selector.unregister(end)
                end.close()


class _Pair:
    def __init__(self, near: socket.socket, far: socket.socket) -> None:
        self.near, self.far = near, far
        self.waiting: deque[tuple[float, socket.socket, bytes]] = deque()  # due, to, bytes

    def other(self, end: socket.socket) -> socket.socket:
        return self.far if end is self.near else self.near

    def send(self, now_s: float) -> bool:
        """Hand on what is due; return whether the connection still stands."""
        while self.waiting and self.waiting[0][0] <= now_s:
            due_s, end, data = self.waiting.popleft()
            try:
                sent = end.send(data)
            except BlockingIOError:
                sent = 0
            except OSError:
                return False
            if sent < len(data):
                self.waiting.appendleft((due_s, end, data[sent:]))
                return True
        return True
