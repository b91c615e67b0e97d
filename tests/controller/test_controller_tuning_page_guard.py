"""Who may talk to the tuning page."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest

from controller.tuning.page.guard import Guard, cookie_name

KEY = "s3cret"
HOST = "127.0.0.1:8350"
COOKIE = f"surefoot_tune_8350={KEY}"


def ask(
    path: str = "/", *, query: str = "", kind: str = "http", headers: list[tuple[str, str]] | None = None
) -> list[MutableMapping[str, Any]]:
    """Send one request through the guard and return what it sent back; the page answers 'page'."""
    sent: list[MutableMapping[str, Any]] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"page"})

    async def receive() -> MutableMapping[str, Any]:
        raise AssertionError("the guard reads no body")

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(message)

    given = [("host", HOST)] if headers is None else headers
    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(name.encode(), value.encode()) for name, value in given],
    }
    asyncio.run(Guard(app, KEY)(scope, receive, send))
    return sent


def passes(*headers: tuple[str, str], kind: str = "http", path: str = "/") -> bool:
    answer = ask(path, kind=kind, headers=list(headers))
    return answer[-1].get("body") == b"page"


def test_the_printed_address_sets_the_cookie_and_leads_to_the_page_without_the_key() -> None:
    start = ask(query=f"key={KEY}")[0]
    headers = {name.decode(): value.decode() for name, value in start["headers"]}
    assert start["status"] == 303
    assert headers["location"] == "/"
    cookie = headers["set-cookie"]
    assert cookie.startswith(COOKIE + ";")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert passes(("host", HOST), ("cookie", f"other=1; {COOKIE}"))


@pytest.mark.parametrize(
    "query", ["", "key=", "key=wrong", f"key={KEY}x", f"key={KEY}&key=wrong", f"key=wrong&key={KEY}"]
)
def test_without_the_key_there_is_no_page(query: str) -> None:
    start, body = ask(query=query)
    assert start["status"] == 403
    assert b"printed" in body["body"]
    assert not any(name == b"set-cookie" for name, _ in start["headers"])


@pytest.mark.parametrize(
    "cookie", ["surefoot_tune_8350=wrong", "surefoot_tune_8351=s3cret", "surefoot_tune_8350=", "x", ";"]
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_without_the_cookie_of_this_run_neither_requests_nor_sockets_pass(cookie: str, kind: str) -> None:
    assert not passes(("host", HOST), ("cookie", cookie), kind=kind)


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:8350", "127.0.0.1.evil.example:8350", "127.0.0.1@evil.example", "", "0.0.0.0:8350",
     "192.168.1.4:8350", "localhost:8350:80", "localhost:x", "[::1", "127.0.0.1:8350, evil.example"],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_a_name_that_was_rebound_to_this_machine_is_refused(host: str, kind: str) -> None:
    assert not passes(("host", host), ("cookie", COOKIE), kind=kind)
    assert b"location" not in dict(ask(query=f"key={KEY}", headers=[("host", host)])[0].get("headers", ()))


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://127.0.0.1:8350", "http://127.0.0.1:8351", "http://localhost:8350", ""],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_another_site_cannot_write_with_this_browsers_cookie(origin: str, kind: str) -> None:
    assert not passes(("host", HOST), ("cookie", COOKIE), ("origin", origin), kind=kind)


@pytest.mark.parametrize("host", ["127.0.0.1:8350", "localhost:8350", "LOCALHOST:8350", "[::1]:8350"])
def test_the_page_itself_passes_under_each_name_of_this_machine(host: str) -> None:
    assert passes(("host", host), ("cookie", COOKIE), ("origin", f"http://{host}"))
    assert passes(("host", host), ("cookie", COOKIE), kind="websocket")


def test_a_header_that_comes_twice_counts_as_foreign() -> None:
    assert not passes(("host", HOST), ("host", "evil.example"), ("cookie", COOKIE))
    assert not passes(
        ("host", HOST), ("cookie", COOKIE), ("origin", f"http://{HOST}"), ("origin", "http://evil.example")
    )


def test_two_runs_do_not_share_a_cookie() -> None:
    names = {cookie_name(host) for host in ("127.0.0.1:8350", "127.0.0.1:8351", "127.0.0.1", "[::1]:9000")}
    assert len(names) == 4


def test_whatever_is_answered_forbids_frames_and_foreign_sources() -> None:
    for answer in (ask(), ask(headers=[("host", HOST), ("cookie", COOKIE)])):
        headers = dict(answer[0]["headers"])
        assert b"default-src 'self'" in headers[b"content-security-policy"]
        assert b"frame-ancestors 'none'" in headers[b"content-security-policy"]
        assert headers[b"x-frame-options"] == b"DENY"
