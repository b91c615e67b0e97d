"""What Zenoh turned away, in the log: who came without a certificate, who said what it may not say.

Zenoh writes its log to the process's standard output and tells of denied messages only on its most
talkative level, a line for each message, denied or not. So its output goes to a file in memory, which
never blocks and costs the writer a few microseconds, and a thread reads and empties it four times a second. Node
processes print nothing themselves; their Python's `sys.stdout` still leads where it led. Where RUST_LOG is set,
somebody wants to read Zenoh's own log: it goes where it always goes, and nothing is picked from it.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import threading
import time
from collections import Counter
from itertools import islice
from typing import Any, Final, Self

import zenoh

from bridge.refusals import Refusals
from bridge.transport.links import LinkWatch

FILTER: Final = ",".join(
    (
        "zenoh_link_tls=warn",
        "zenoh::net::runtime::orchestrator=debug",
        "zenoh::net::routing::interceptor::access_control=trace",
    )
)
SWEEP_S: Final = 0.25
LOOK_TURNS: Final = 4  # sweeps between two looks at the links
_READ_BYTES = 1 << 18
_MOST_PARSED = 200  # lines a sweep looks at closely; of more it tells how many
_ZID = rb"([0-9a-f]{1,32})"
# what a session tries is judged from a cache, and says so; filling the cache writes the same words about everything
# that could be tried, except for declarations
_DENIED = re.compile(
    rb"(?:Using cached result: " + _ZID + rb" is unauthorized to ([A-Za-z ]+)"
    rb"|" + _ZID + rb" on \S+ is unauthorized to (Liveliness Token|Declare Subscriber|Declare Queryable))"
    rb" \(ingress\) on (\S+)"
)
_NAMED = re.compile(_ZID + rb" on \S*CertCommonName\(([^)]*)\)")
_HANDSHAKE = re.compile(rb"zenoh_link_tls::\w+\S*: +(.+?)\. Hint:")
_CONNECT = re.compile(
    rb"Unable to connect to [\w ]+? (\S+?)!.*?((?:invalid peer|received fatal)[^\n]*?)(?: at /|\.?\n)"
)
_COLOUR = re.compile(rb"\x1b\[[0-9;]*m")
_WORDS = {"Declare Subscriber": "read", "Declare Queryable": "answer for", "Liveliness Token": "claim"}


class Digest:
    """Reads Zenoh's lines and passes on what was refused."""

    def __init__(self, refusals: Refusals) -> None:
        self._refusals = refusals
        self._names: dict[bytes, str] = {}  # session -> name in its certificate

    def take(self, text: bytes, now_s: float) -> None:
        """Take in what Zenoh wrote since the last call."""
        if b"CertCommonName" in text or b"\x1b" in text:
            text = _COLOUR.sub(b"", text)
            for session, name in _NAMED.findall(text):
                if len(self._names) < 1024 or session in self._names:
                    self._names[session] = name.decode("utf-8", "replace")
        if b" is unauthorized to " in text:
            self._take_denials(text, now_s)
        if b"zenoh_link_tls" in text:
            for reason, count in Counter(_HANDSHAKE.findall(text)).items():
                self._refusals.note(f"a connection: {reason.decode('utf-8', 'replace')}", now_s, count)
        if b"Unable to connect" in text:
            for (endpoint, reason), count in Counter(_CONNECT.findall(text)).items():
                where = endpoint.decode("utf-8", "replace")
                self._refusals.note(f"to connect to {where}: {reason.decode('utf-8', 'replace')}", now_s, count)

    def _take_denials(self, text: bytes, now_s: float) -> None:
        found: Counter[tuple[str, bytes, bytes]] = Counter()
        for match in islice(_DENIED.finditer(text), _MOST_PARSED):
            session, action, declarer, declaration, key = match.groups()
            name = self._names.get(session or declarer, "a session without a known name")
            found[name, action or declaration, key] += 1
        # what was not looked at closely is taken to be more of what was most frequent
        rest = text.count(b" is unauthorized to ") - _MOST_PARSED if found.total() >= _MOST_PARSED else 0
        for (name, action, key), count in found.most_common():
            verb = _WORDS.get(action.decode(), action.decode().lower())
            self._refusals.note(f"{name} may not {verb} {key.decode('utf-8', 'replace')}", now_s, count + rest)
            rest = 0


class WireLog:
    """While open, puts into `log` what this process's Zenoh session refuses; to be opened before the session."""

    def __init__(self, log: logging.Logger) -> None:
        self._digest_refusals = Refusals(log.warning)
        self._digest = Digest(self._digest_refusals)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wire-log", daemon=True)
        self._memory = -1
        self._links: LinkWatch | None = None
        self._lock = threading.Lock()
        self._log = log

    def watch(self, session: Any | None) -> None:
        """Tell from now on who comes to `session` and who leaves; None, before it is closed: nobody's any more."""
        with self._lock:
            self._links = None if session is None else LinkWatch(session, self._log)

    def __enter__(self) -> Self:
        if "RUST_LOG" in os.environ:
            start: Any = zenoh.try_init_log_from_env  # its stub says nothing of what it returns
            start()
            self._thread.start()
            return self
        self._memory = os.memfd_create("zenoh-log")
        writer = os.open(f"/proc/self/fd/{self._memory}", os.O_WRONLY | os.O_APPEND)  # after a cut, go on at the start
        sys.stdout.flush()
        sys.stdout = os.fdopen(os.dup(1), "w", buffering=1)
        os.dup2(writer, 1)
        os.close(writer)
        zenoh.init_log_from_env_or(FILTER)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join()
        if self._memory >= 0:
            sys.stdout.flush()
            os.dup2(sys.stdout.fileno(), 1)
            os.close(self._memory)

    def _run(self) -> None:
        turn = 0
        while True:
            turn += 1
            ending = self._stop.wait(SWEEP_S)
            self._sweep()
            if ending:
                return
            with self._lock:
                if self._links is not None and turn % LOOK_TURNS == 0:
                    self._links.look()

    def _sweep(self) -> None:
        text = os.pread(self._memory, _READ_BYTES, 0) if self._memory >= 0 else b""
        if text:
            os.ftruncate(self._memory, 0)
            self._digest.take(text, time.monotonic())
        self._digest_refusals.sweep(time.monotonic())
