"""What every request passes: host, token, origin, rate and size; and the headers that every answer gets."""

from __future__ import annotations

import asyncio
import json
import secrets
import time
from collections import OrderedDict
from http.cookies import CookieError, SimpleCookie
from typing import Any, NamedTuple
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("localhost", "127.0.0.1", "::1")
# A body is a sentence or a few settings; who sends it slower than this is not waited for.
MOST_BODY_BYTES, _BODY_S = 16_384, 10.0
# Requests in a second and at once, by address: pictures of a playing page, and sentences.
_READ_RATE, _READ_BURST = 500.0, 1500.0
_WRITE_RATE, _WRITE_BURST = 20.0, 60.0
_MOST_ADDRESSES = 1000
_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "microphone=(self), camera=(), geolocation=()",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


class Refusal(NamedTuple):
    """Why a request is not answered."""

    status: int
    reason: str


class Guard:
    """ASGI middleware around the page. A body arrives as `request.state.body`, a JSON object."""

    def __init__(self, app: ASGIApp, token: str | None) -> None:
        """Guard an application.

        Args:
            app: the application.
            token: required of every request; None: only this machine's own names are answered, without a token.
        """
        self._app, self._token = app, token
        self._reads = _Buckets(_READ_RATE, _READ_BURST)
        self._writes = _Buckets(_WRITE_RATE, _WRITE_BURST)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        send = _with_headers(send)
        response: Response | None
        if (response := self._login(scope)) is None:
            refusal = self._refusal(scope) or await _read_body(scope, receive)
            response = None if refusal is None else JSONResponse({"error": refusal.reason}, refusal.status)
        await (response or self._app)(scope, receive, send)

    def _login(self, scope: Scope) -> Response | None:
        """Return the answer to the address with the token: a cookie, so that the token leaves the address bar."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if (
            self._token is None
            or scope["path"] != "/"
            or not secrets.compare_digest(given.encode(), self._token.encode())
        ):
            return None
        response = RedirectResponse("/", 303)
        response.set_cookie(_cookie(scope), self._token, httponly=True, samesite="strict")
        return response

    def _refusal(self, scope: Scope) -> Refusal | None:
        headers = Headers(scope=scope)
        host = _host(headers.get("host", ""))
        if self._token is None:
            # A foreign page can point its own name at this machine (DNS rebinding), but not change this header.
            if host not in LOOPBACK:
                return Refusal(421, "expected localhost as the name of this machine")
        elif not self._has_token(scope, headers):
            return Refusal(401, "open the address with the token that appocc serve has printed")
        buckets = self._reads if scope["method"] in ("GET", "HEAD") else self._writes
        if not buckets.take(scope["client"][0] if scope.get("client") else ""):
            return Refusal(429, "too many requests: wait a second")
        if scope["method"] not in ("GET", "HEAD"):
            origin = headers.get("origin")
            if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
                return Refusal(403, "this request comes from another page")
            if origin is not None and urlsplit(origin).netloc != headers.get("host", ""):
                return Refusal(403, "this request comes from another page")
            if headers.get("content-type", "").split(";")[0].strip().lower() != "application/json":
                return Refusal(415, "expected JSON (content-type: application/json)")
        return None

    def _has_token(self, scope: Scope, headers: Headers) -> bool:
        assert self._token is not None
        given = headers.get("authorization", "").removeprefix("Bearer ")
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(_cookie(scope))
        except CookieError:
            cookie = None
        wanted = self._token.encode()
        return any(secrets.compare_digest(one.encode(), wanted) for one in (given, cookie.value if cookie else ""))


class _Buckets:
    """Token buckets by address."""

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, address: str) -> bool:
        """Return whether one more request of an address is within its rate."""
        now = time.monotonic()
        left, at = self._left.pop(address, (self._burst, now))
        left = min(left + (now - at) * self._rate, self._burst)
        self._left[address] = (max(left - 1, 0.0), now)
        if len(self._left) > _MOST_ADDRESSES:
            self._left.popitem(last=False)
        return left >= 1


def _host(header: str) -> str:
    """Return the name in a Host header, without the port."""
    try:
        return urlsplit(f"//{header}").hostname or ""
    except ValueError:
        return ""


def _cookie(scope: Scope) -> str:
    """Return the name of the cookie: browsers share cookies between the ports of a machine."""
    server = scope.get("server")
    return f"appocc-{server[1] if server else 0}"


async def _read_body(scope: Scope, receive: Receive) -> Refusal | None:
    """Read the JSON body of a request into its state."""
    if scope["method"] in ("GET", "HEAD"):
        return None
    try:
        async with asyncio.timeout(_BODY_S):
            body = await _received(receive)
    except TimeoutError:
        return Refusal(408, f"expected the whole body within {_BODY_S:g} s")
    if body is None:
        return Refusal(413, f"expected a body of at most {MOST_BODY_BYTES} bytes")
    try:
        value: Any = json.loads(body or b"{}")
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        return Refusal(400, "expected a JSON object")
    scope.setdefault("state", {})["body"] = value
    return None


async def _received(receive: Receive) -> bytes | None:
    """Return the body of a request; None if it is too large."""
    body = b""
    while True:
        message = await receive()
        body += bytes(message.get("body", b""))
        if len(body) > MOST_BODY_BYTES:
            return None
        if message["type"] != "http.request" or not message.get("more_body"):
            return body


def _with_headers(send: Send) -> Send:
    """Return a sender that adds the headers of every answer."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return sent
