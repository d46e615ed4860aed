"""Who is answered: hosts, tokens, origins, rates."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.testclient import TestClient

from cli.server import guard
from cli.server.cache import BoundedCache
from cli.server.guard import Guard
from cli.server.running import is_loopback

JSON = {"content-type": "application/json"}


async def echo(request: Request) -> Response:
    return JSONResponse({"body": request.state.body if request.method == "POST" else None})


def guarded(token: str | None = None, host: str = "127.0.0.1") -> TestClient:
    app = Starlette(routes=[Route("/", echo), Route("/x", echo, methods=["GET", "POST"])])
    return TestClient(Guard(app, token), base_url=f"http://{host}:8040", follow_redirects=False)


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "[::1]", "LOCALHOST"])
def test_names_of_this_machine_are_answered(host: str) -> None:
    assert guarded(host=host).get("/x").status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "192.168.0.7"])
def test_foreign_names_are_refused(host: str) -> None:
    assert guarded(host=host).get("/x").status_code == 421


@pytest.mark.parametrize("header", ["", "[::1", "localhost@evil.example", "evil.example:80:80", "\x00"])
def test_odd_names_are_refused(header: str) -> None:
    assert guarded().get("/x", headers={"host": header}).status_code == 421


def test_with_a_token_nothing_is_answered_without_it() -> None:
    client = guarded("secret", "192.168.0.7")
    assert client.get("/x").status_code == 401
    assert client.get("/?token=wrong").status_code == 401
    assert client.get("/x?token=secret").status_code == 401, "the token is for the page only"
    assert client.get("/x", headers={"authorization": "Bearer wrong"}).status_code == 401
    assert client.get("/x", headers={"authorization": "Bearer secret"}).status_code == 200


def test_the_address_with_the_token_becomes_a_cookie() -> None:
    client = guarded("secret", "192.168.0.7")
    login = client.get("/?token=secret")
    assert (login.status_code, login.headers["location"]) == (303, "/")
    assert {"HttpOnly", "SameSite=strict"} <= set(login.headers["set-cookie"].split("; "))
    assert client.get("/").status_code == 200
    assert client.post("/x", json={}).status_code == 200


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"origin": "http://127.0.0.1:8040"}, 200),
        ({"sec-fetch-site": "same-origin"}, 200),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:9999"}, 403),
        ({"origin": "null"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
        ({"content-type": "text/plain"}, 415),
        ({"content-type": "application/x-www-form-urlencoded"}, 415),
    ],
)
def test_other_pages_cannot_send(headers: dict[str, str], status: int) -> None:
    assert guarded().post("/x", content=b"{}", headers={**JSON, **headers}).status_code == status


def test_every_answer_has_the_headers() -> None:
    for answer in (guarded().get("/x"), guarded(host="evil.example").get("/x"), guarded().get("/missing")):
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["cross-origin-resource-policy"] == "same-origin"
        assert answer.headers["cache-control"] == "no-store"


def test_too_many_sentences_are_refused_and_others_still_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    client = guarded()
    codes = [client.post("/x", json={}).status_code for _ in range(70)]
    assert codes[:60] == [200] * 60
    assert set(codes[60:]) == {429}
    assert client.get("/x").status_code == 200
    monkeypatch.setattr(time, "monotonic", lambda: 101.0)
    assert client.post("/x", json={}).status_code == 200


def test_a_slow_body_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "_BODY_S", 0.05)
    sent: list[Any] = []

    async def never() -> Any:
        await asyncio.sleep(3600)

    async def send(message: Any) -> None:
        sent.append(message)

    headers = [(b"host", b"localhost"), (b"content-type", b"application/json")]
    scope = {"type": "http", "method": "POST", "path": "/x", "query_string": b"", "headers": headers}
    asyncio.run(Guard(Starlette(), None)(scope, never, send))
    assert sent[0]["status"] == 408


@pytest.mark.parametrize(
    ("host", "own"), [("localhost", True), ("127.0.0.5", True), ("::1", True), ("0.0.0.0", False), ("example", False)]
)
def test_loopback_addresses_are_known(host: str, own: bool) -> None:
    assert is_loopback(host) is own


def test_the_cache_keeps_what_was_used_last_within_its_size() -> None:
    cache: BoundedCache[str, bytes] = BoundedCache(10, len)
    made: list[str] = []

    def get(key: str) -> bytes:
        return cache.get(key, lambda: made.append(key) or b"1234")  # type: ignore[func-returns-value]

    for key in ("a", "b", "a", "c", "a", "b"):
        assert get(key) == b"1234"
        assert cache.size <= 10
    assert made == ["a", "b", "c", "b"]
