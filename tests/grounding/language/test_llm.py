"""The language model's reading counts only if it is a valid query and comes in time."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest

from appocc.errors import DataError
from grounding.language.llm import ChatEndpoint

GOOD = {"status": "ok", "action": "park", "relation": "behind", "landmark": "referent"} | {
    "referent": {"noun": "car", "head": "beetle", "colour": "red", "qualifiers": ["left_side"]}
}
Answers = Callable[[bytes], ChatEndpoint]


@pytest.fixture
def answers() -> Iterator[Callable[..., ChatEndpoint]]:
    """An endpoint that answers with given bytes."""
    servers = []

    def start(body: bytes, status: int = 200, wait_s: float = 0.0, limit_s: float = 60.0) -> ChatEndpoint:
        asked: list[dict[str, Any]] = []

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                length = int(self.headers["Content-Length"])
                asked.append(json.loads(self.rfile.read(length)) | {"auth": self.headers.get("Authorization")})
                time.sleep(wait_s)
                self.send_response(status)
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                pass

        server = HTTPServer(("127.0.0.1", 0), Handler)
        server.asked = asked  # type: ignore[attr-defined]
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return ChatEndpoint(f"http://127.0.0.1:{server.server_port}/v1/chat/completions", "m", "secret", limit_s)

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def chat(content: str) -> bytes:
    return json.dumps({"choices": [{"message": {"content": content}}]}).encode()


def test_its_reading(answers: Callable[..., ChatEndpoint]) -> None:
    reading = answers(chat(f"```json\n{json.dumps(GOOD)}\n```")).read("park behind the red beetle on the left")
    query = reading.query
    assert reading.problem is None
    assert query.referent
    assert (query.action, query.relation, query.referent.head) == ("park", "behind", "beetle")
    assert query.referent.qualifiers == ("left_side",)
    assert query.command == "park behind the red beetle on the left"


@pytest.mark.parametrize(
    "body",
    [
        chat(json.dumps(GOOD | {"action": "fly"})),
        chat(json.dumps(GOOD | {"status": "reject"})),
        chat(json.dumps({"status": "ok"})),
        chat(json.dumps(GOOD | {"distance_m": -3.0})),
        chat(json.dumps(GOOD | {"referent": {"noun": "car", "head": "x", "colour": "mauve"}})),
        chat("I would park."),
        b"{}",
        b"[]",
        b'{"choices": [{"message": {"content": 7}}]}',
        b"\xff\xfe",
        b"",
    ],
)
def test_invalid_answers_are_not_used(answers: Callable[..., ChatEndpoint], body: bytes) -> None:
    with pytest.raises(DataError, match=r"^the language model was not used: "):
        answers(body).read("park behind the red car")


@pytest.mark.parametrize(("status", "wait_s", "limit_s"), [(500, 0.0, 60.0), (200, 1.0, 0.1)])
def test_a_failing_or_slow_endpoint_is_not_waited_for(
    answers: Callable[..., ChatEndpoint], status: int, wait_s: float, limit_s: float
) -> None:
    with pytest.raises(DataError, match="was not used"):
        answers(chat(json.dumps(GOOD)), status, wait_s, limit_s).read("park behind the red car")


def test_an_endpoint_that_sends_single_bytes_is_not_waited_for() -> None:
    server, ended = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def drip() -> None:
        asked, _ = server.accept()
        with asked, suppress(OSError):
            asked.recv(100_000)
            asked.sendall(b"HTTP/1.1 200 OK\r\n\r\n")
            while not ended.wait(0.02):
                asked.sendall(b" ")

    dripping = threading.Thread(target=drip, daemon=True)
    dripping.start()
    with pytest.raises(DataError, match=r"^the language model was not used: no answer within 0\.2 s$"):
        ChatEndpoint(f"http://127.0.0.1:{server.getsockname()[1]}/", "m", None, 0.2).read("stop")
    assert dripping.is_alive()
    ended.set()
    dripping.join(10)
    server.close()


def test_deeply_nested_answers_are_not_used(answers: Callable[..., ChatEndpoint]) -> None:
    with pytest.raises(DataError, match="was not used"):
        answers(b"[" * 50_000).read("stop")


def test_an_unreachable_endpoint() -> None:
    with pytest.raises(DataError, match="was not used"):
        ChatEndpoint("http://127.0.0.1:9/", "m", None, 0.5).read("stop")


def test_what_the_model_rejects_is_no_command(answers: Callable[..., ChatEndpoint]) -> None:
    assert answers(chat('{"status": "reject"}')).read("park behind the red car").problem is not None


@pytest.mark.parametrize(
    "url",
    [
        "file:///etc/passwd",
        "ftp://a/b",
        "localhost:80",
        "http://",
        "",
        "http://[::1",
        "http://:80",
        "http://a:99999/",
    ],
)
def test_invalid_addresses(url: str) -> None:
    with pytest.raises(DataError, match="expected an address that begins with http"):
        ChatEndpoint(url, "m")
