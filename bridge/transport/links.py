"""Who is at the other ends of a session's links, and a line whenever that changes."""

from __future__ import annotations

import logging
from typing import Any

from bridge.keys.identity import IDENTITIES


class LinkWatch:
    """Tells the log who came and who left."""

    def __init__(self, session: Any, log: logging.Logger) -> None:
        self._session, self._log = session, log
        self._seen: dict[tuple[str, str], str | None] = {}  # (session, address) at the other end -> its certificate

    def look(self) -> None:
        """Compare with the last look."""
        now = {(str(link.zid), str(link.dst)): link.auth_identifier for link in self._session.info.links()}
        for link, name in now.items():
            if link not in self._seen:
                self._came(link[1], name)
        for link, name in self._seen.items():
            if link not in now:
                self._log.info("gone: %s at %s", name or "somebody", link[1])
        self._seen = now

    def _came(self, address: str, name: str | None) -> None:
        if name is None:
            self._log.info("connected: somebody without a certificate at %s", address)
        elif name in IDENTITIES:
            self._log.info("connected: %s at %s", name, address)
        else:
            self._log.warning(
                "refused: %s at %s: a certificate of our authority, but no role; it may say and hear nothing",
                name,
                address,
            )
