"""What Zenoh turned away, in the log: who came without a certificate, who said what it may not say.

Zenoh writes its log to the process's standard output and tells of denied messages only on its most
talkative level, a line for each message, denied or not. So its output goes to a file in memory, which
never blocks and costs the writer a few microseconds, and a thread reads and empties it four times a second. Node
processes print nothing themselves; their Python's `sys.stdout` still leads where it led.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import threading
import time
from collections import Counter
from typing import Final, Self

import zenoh

from bridge.refusals import Refusals

FILTER: Final = ",".join(
    (
        "zenoh_link_tls=warn",
        "zenoh::net::runtime::orchestrator=debug",
        "zenoh::net::routing::interceptor::access_control=trace",
    )
)
SWEEP_S: Final = 0.25
_READ_BYTES = 1 << 18
_MOST_PARSED = 200  # lines a sweep looks at closely; of more it tells how many
_ZID = rb"([0-9a-f]{1,32})"
_DENIED = re.compile(_ZID + rb"(?: on (\S+))? is unauthorized to ([A-Za-z ]+) \(ingress\) on (\S+)")
_NAMED = re.compile(_ZID + rb" on \S*CertCommonName\(([^)]*)\)")
_HANDSHAKE = re.compile(rb"zenoh_link_tls::\w+\S*: +(.+?)\. Hint:")
_CONNECT = re.compile(
    rb"Unable to connect to [\w ]+? (\S+?)!.*?((?:invalid peer|received fatal)[^\n]*?)(?: at /|\.?\n)"
)
_COLOUR = re.compile(rb"\x1b\[[0-9;]*m")
_WORDS = {"Put": "put", "Delete": "delete", "Declare Subscriber": "read", "Liveliness Token": "say that it lives:"}


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
        for number, match in enumerate(_DENIED.finditer(text)):
            if number >= _MOST_PARSED:
                break
            session, _subject, action, key = match.groups()
            found[self._names.get(session, "someone without a known name"), action, key] += 1
        rest = text.count(b" is unauthorized to ") - text.count(b"(egress)") - sum(found.values())
        for (name, action, key), count in found.items():
            verb = _WORDS.get(action.decode(), action.decode().lower())
            # what was not looked at closely is counted with what was most frequent
            more = max(rest, 0) if (name, action, key) == found.most_common(1)[0][0] else 0
            self._refusals.note(f"{name} may not {verb} {key.decode('utf-8', 'replace')}", now_s, count + more)


class WireLog:
    """While open, puts into `log` what this process's Zenoh session refuses; to be opened before the session."""

    def __init__(self, log: logging.Logger) -> None:
        self._digest_refusals = Refusals(log.warning)
        self._digest = Digest(self._digest_refusals)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wire-log", daemon=True)
        self._memory = -1

    def __enter__(self) -> Self:
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
        sys.stdout.flush()
        os.dup2(sys.stdout.fileno(), 1)
        os.close(self._memory)

    def _run(self) -> None:
        while not self._stop.wait(SWEEP_S):
            self._sweep()
        self._sweep()

    def _sweep(self) -> None:
        text = os.pread(self._memory, _READ_BYTES, 0)
        if text:
            os.ftruncate(self._memory, 0)
            self._digest.take(text, time.monotonic())
        self._digest_refusals.sweep(time.monotonic())
