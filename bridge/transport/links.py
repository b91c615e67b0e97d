"""Who is at the other ends of a session's links, and a line whenever that changes."""

from __future__ import annotations

import logging
from typing import Any


class LinkWatch:
    """Tells the log who came and who left."""

    def __init__(self, session: Any, log: logging.Logger) -> None:
        self._session, self._log = session, log
        self._seen: dict[str, str] = {}  # session at the other end -> what is known of it

    def look(self) -> None:
        """Compare with the last look."""
        now = {
            str(link.zid): f"{link.auth_identifier or 'a session without certificate'} at {link.dst}"
            for link in self._session.info.links()
        }
        for session, name in now.items():
            if session not in self._seen:
                self._log.info("connected: %s", name)
        for session, name in self._seen.items():
            if session not in now:
                self._log.info("gone: %s", name)
        self._seen = now
