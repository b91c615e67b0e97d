"""Who may talk to the page: this machine's user, through the address that was printed, from the page itself.

A page on loopback is not private by that alone. A website open in the same browser can send requests to it, or
read its answers after rebinding a name of its own to 127.0.0.1; another user of the machine can open it. This page
writes a file that a running walker reads. So each request, and each WebSocket, must satisfy all of these:

- `Host` is a loopback name, which a rebound name is not;
- `Origin`, where the browser sends one, is that very host: no other site, no other port;
- it carries this run's key, in a cookie that the printed address sets.
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LOOPBACK: Final = re.compile(r"(?:127\.0\.0\.1|localhost|\[::1\])(?::(\d{1,5}))?", re.IGNORECASE)
QUERY: Final = "key"
HEADERS: Final = (
    # nothing from elsewhere, nothing to elsewhere, in nobody's frame; the library compiles its templates in the page
    (
        b"content-security-policy",
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        b"img-src 'self' data: blob:; font-src 'self' data:; frame-ancestors 'none'; form-action 'self'; "
        b"base-uri 'none'; object-src 'none'",
    ),
    (b"x-frame-options", b"DENY"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
)


class Guard:
    """ASGI application that lets through to `app` only what may talk to it."""

    def __init__(self, app: App, key: str) -> None:
        """Guard `app` with `key`, which the first request brings as `/?key=...`."""
        self._app = app
        self._key = key

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = _headers(scope)
        reason = _foreign(headers)
        if not reason and scope["type"] == "http" and scope["path"] == "/" and self._matches(_query_key(scope)):
            await self._let_in(headers["host"], send)
            return
        if not reason and not self._matches(_cookie(headers.get("cookie", ""), cookie_name(headers["host"]))):
            reason = "open the address that `surefoot tune --serve` printed: it holds the key to this page"
        if reason:
            await _refuse(scope, send, reason)
            return
        await self._app(scope, receive, _with_headers(send))

    def _matches(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._key.encode())

    async def _let_in(self, host: str, send: Send) -> None:
        """Put the key into a cookie and go to the page without it, so that it stays out of the history."""
        cookie = f"{cookie_name(host)}={self._key}; HttpOnly; SameSite=Strict; Path=/"
        await _answer(send, 303, b"", ((b"location", b"/"), (b"set-cookie", cookie.encode())))


def cookie_name(host: str) -> str:
    """Return the name of the cookie for `host`: browsers share cookies between ports, two runs must not."""
    match = LOOPBACK.fullmatch(host)
    return f"surefoot_tune_{(match and match[1]) or 80}"


def _headers(scope: Scope) -> dict[str, str]:
    """Return the headers, lower case; of one that comes twice, a text that fits nothing."""
    found: dict[str, str] = {}
    for name, value in scope["headers"]:
        key, text = name.decode("latin-1").lower(), value.decode("latin-1")
        found[key] = f"{found[key]}, {text}" if key in found else text
    return found


def _foreign(headers: dict[str, str]) -> str:
    """Return why the request is not from this page, or ''."""
    host = headers.get("host", "")
    if not LOOPBACK.fullmatch(host):
        return f"host '{host}' is not this machine: use 127.0.0.1 or localhost"
    origin = headers.get("origin")
    if origin is not None and origin.lower() != f"http://{host.lower()}":
        return f"origin '{origin}' is not this page"
    return ""


def _query_key(scope: Scope) -> str:
    given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get(QUERY, [])
    return given[0] if len(given) == 1 else ""


def _cookie(header: str, name: str) -> str:
    try:
        morsel = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


async def _refuse(scope: Scope, send: Send, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": reason[:100]})
        return
    await _answer(send, 403, f"surefoot tune: {reason}\n".encode())


async def _answer(send: Send, status: int, body: bytes, more: tuple[tuple[bytes, bytes], ...] = ()) -> None:
    start = (b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store")
    await send({"type": "http.response.start", "status": status, "headers": [*start, *HEADERS, *more]})
    await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *HEADERS]
        await send(message)

    return sending
