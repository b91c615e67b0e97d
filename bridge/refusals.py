"""Saying what was refused: at once when it is new, then how often, and never more than the log can bear."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

PERIOD_S: Final = 5.0  # between two lines about the same thing
MOST_KINDS: Final = 32  # of things told apart; an attacker who varies his words fills no memory
FLOOD_FACTOR: Final = 20  # times the usual rate; the system is tested at ten times it
_NUMBER = re.compile(r"-?\d[\d.]*")
_OTHER = "other things, more of them than are told apart"


class _Kind:
    __slots__ = ("last", "said_s", "unsaid")

    def __init__(self, now_s: float) -> None:
        self.last, self.said_s, self.unsaid = "", now_s, 0


class Refusals:
    """Counts what is refused by kind: texts that differ in their numbers alone are of one kind.

    Args:
        say: is given a line for the log.
        period_s: at least so long passes between two lines of a kind [s].
    """

    def __init__(self, say: Callable[[str], None], period_s: float = PERIOD_S) -> None:
        self._say, self._period_s = say, period_s
        self._kinds: dict[str, _Kind] = {}
        self.total = 0

    def note(self, text: str, now_s: float, count: int = 1) -> None:
        """Take in that `text` was the reason `count` times."""
        self.total += count
        name = _NUMBER.sub("#", text)
        if name not in self._kinds and len(self._kinds) >= MOST_KINDS:
            name = text = _OTHER
        kind = self._kinds.get(name)
        if kind is None:
            kind = self._kinds[name] = _Kind(now_s)
            self._say(f"refused: {text}" + (f" ({count} times)" if count > 1 else ""))
            return
        kind.last = text
        kind.unsaid += count
        self._tell(kind, now_s)

    def sweep(self, now_s: float) -> None:
        """Say what is still to be said of things that no longer happen."""
        for kind in self._kinds.values():
            self._tell(kind, now_s)

    def _tell(self, kind: _Kind, now_s: float) -> None:
        waited_s = now_s - kind.said_s
        if kind.unsaid and waited_s >= self._period_s:
            self._say(f"refused: {kind.last} ({kind.unsaid} times in {waited_s:.0f} s)")
            kind.said_s, kind.unsaid = now_s, 0


class FloodWatch:
    """Notices that far more arrives than a topic carries.

    `arrived` is counted up by the transport's thread; `judge` is asked by the reader.
    """

    def __init__(self, key: str, rate_hz: float) -> None:
        self.arrived = 0
        self._key, self._rate_hz = key, rate_hz
        self._before, self._since_ns = 0, 0

    def judge(self, now_ns: int) -> str | None:
        """Return what is wrong with the last second or so, '' for nothing; None while the second is not over."""
        span_s = (now_ns - self._since_ns) * 1e-9
        if span_s < 1.0:
            return None
        count, known = self.arrived - self._before, self._since_ns > 0
        self._before, self._since_ns = self.arrived, now_ns
        if not known or count <= FLOOD_FACTOR * self._rate_hz * span_s:
            return ""
        per_s, usual = count / span_s, self._rate_hz
        return f"{self._key}: a flood, {per_s:.0f} a second where {usual:.0f} are usual; only the newest is read"
