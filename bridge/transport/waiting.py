"""Opening a session that waits for a router, so that signals are heard and the wait is told.

Zenoh's `open` of a client returns when a router has answered, and until then Python runs no signal handler.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Any, Final

from bridge.errors import TransportError

LOOK_S: Final = 0.05
TELL_S: Final = 2.0  # after this long somebody wonders

_LOG = logging.getLogger(__name__)


def open_waiting(opening: Callable[[], Any], role: str, routers: Sequence[str], limit_s: float | None) -> Any:
    """Return what `opening` returns, called in a thread of its own.

    Args:
        opening: opens the session; may never come back.
        role: who waits.
        routers: for whom.
        limit_s: how long at most [s]; None: until they are there, as a process does that is started before its router.

    Raises:
        TransportError: nobody answered in time.
        Exception: what `opening` raised, and what a signal handler raises meanwhile.
    """
    opened: list[Any] = []
    failed: list[Exception] = []

    def run() -> None:
        try:
            opened.append(opening())
        except Exception as error:  # noqa: BLE001 (handed to the thread that waits)
            failed.append(error)

    thread = threading.Thread(target=run, name="wire-opening", daemon=True)  # it may never end
    thread.start()
    waited_s, told = 0.0, False
    while thread.is_alive():
        thread.join(LOOK_S)
        waited_s += LOOK_S
        if waited_s > TELL_S and not told:
            told = True
            _LOG.warning("%s waits for a router at %s (bridge.connect)", role, ", ".join(routers))
        if limit_s is not None and waited_s > limit_s:
            raise TransportError(
                f"{role}: no router answers at {', '.join(routers)} (bridge.connect) within {limit_s:g} s;"
                " surefoot router starts one"
            )
    if failed:
        raise failed[0]
    return opened[0]
