"""Serving the page: on this machine alone, until Ctrl-C."""

from __future__ import annotations

import logging
import secrets
import socket
import warnings
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from bridge.command_line.output import note
from bridge.errors import MissingExtraError, SurefootError
from controller.tuning.page.bench import Bench
from controller.tuning.page.guard import QUERY, Guard

HOST: Final = "127.0.0.1"
DEFAULT_PORT: Final = 8350
STYLE: Final = Path(__file__).with_name("page.css")
GRACE_S: Final = 1  # open pages are not waited for longer


def require_library() -> None:
    """Raise `MissingExtraError` where the library for the page is not installed: before any work is done for it."""
    if find_spec("nicegui") is None:
        raise MissingExtraError("surefoot tune --serve", "nicegui", "tune")


def require_port(port: int) -> None:
    """Raise `SurefootError` where the page could not be opened at `port`: before any work is done for it."""
    listen(port).close()


def serve(bench: Bench, port: int = DEFAULT_PORT) -> int:
    """Serve the page of `bench` on loopback until SIGINT or SIGTERM; say its address on stderr.

    Raises:
        SurefootError: the port is taken, or there is no recording to show.
        MissingExtraError: the library for the page is not installed.
    """
    require_library()
    if not bench.cases:
        raise SurefootError("surefoot tune --serve: no recording to show")
    listening = listen(port)
    key = secrets.token_urlsafe(16)
    address = f"http://{HOST}:{listening.getsockname()[1]}/?{QUERY}={key}"
    with listening:
        _run(bench, listening, key, address)
    return 0


def listen(port: int) -> socket.socket:
    """Return a socket that listens on loopback; port 0 takes a free one.

    Raises:
        SurefootError: the port is taken or not allowed.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a page that just ended does not block the next
    try:
        listening.bind((HOST, port))
        listening.listen(64)
    except OSError as error:
        listening.close()
        raise SurefootError(f"--port {port}: cannot be opened on {HOST}: {error.strerror}; try another") from error
    return listening


def _run(bench: Bench, listening: socket.socket, key: str, address: str) -> None:
    import uvicorn  # noqa: PLC0415 (an extra)
    from fastapi import FastAPI  # noqa: PLC0415
    from nicegui import ui  # noqa: PLC0415

    from controller.tuning.page.board import Board  # noqa: PLC0415

    def page() -> None:
        Board(bench)

    ui.add_css(STYLE, shared=True)
    ui.page("/", title="Surefoot tune", favicon="🦶")(page)
    app = FastAPI(openapi_url=None)
    ui.run_with(app, tailwind=False, show_welcome_message=False, reconnect_timeout=120.0)
    config = uvicorn.Config(
        Guard(app, key),
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        ws="wsproto",
        timeout_graceful_shutdown=GRACE_S,
    )
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    note(f"open {address}   (Ctrl-C ends it)")
    with warnings.catch_warnings():  # at its start the library looks at every object there is, torch's old ones too
        warnings.simplefilter("ignore", FutureWarning)
        with suppress(KeyboardInterrupt):  # the ordinary end
            uvicorn.Server(config).run(sockets=[listening])
