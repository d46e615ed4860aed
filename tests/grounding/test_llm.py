"""A language model is heard only if what it answers in time is a query."""

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
from grounding.language.llm import Endpoint
from grounding.language.parser import read

GOOD = {"status": "ok", "action": "park", "relation": "behind", "landmark": "referent"} | {
    "referent": {"noun": "car", "head": "beetle", "colour": "red", "qualifiers": ["left_side"]}
}
Answers = Callable[[bytes], Endpoint]


@pytest.fixture
def answers() -> Iterator[Callable[..., Endpoint]]:
    """An endpoint that answers with given bytes."""
    servers = []

    def start(body: bytes, status: int = 200, wait_s: float = 0.0, limit_s: float = 60.0) -> Endpoint:
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
        return Endpoint(f"http://127.0.0.1:{server.server_port}/v1/chat/completions", "m", "secret", limit_s)

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def chat(content: str) -> bytes:
    return json.dumps({"choices": [{"message": {"content": content}}]}).encode()


def test_its_query_comes_before_those_of_the_grammar(answers: Callable[..., Endpoint]) -> None:
    first, *others = answers(chat(f"```json\n{json.dumps(GOOD)}\n```")).readings(
        "park behind the red beetle on the left"
    )
    assert first.query.referent
    assert (first.query.action, first.query.relation, first.query.referent.head) == ("park", "behind", "beetle")
    assert first.query.referent.qualifiers == ("left_side",)
    assert first.query.command == "park behind the red beetle on the left"
    assert others


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
def test_what_is_no_query_is_not_heard(answers: Callable[..., Endpoint], body: bytes) -> None:
    given = answers(body).readings("park behind the red car")
    assert given[0].query == read("park behind the red car").query
    assert given[0].notes[-1].startswith("the language model was not heard: ")


@pytest.mark.parametrize(("status", "wait_s", "limit_s"), [(500, 0.0, 60.0), (200, 1.0, 0.1)])
def test_one_that_fails_or_is_slow_is_not_waited_for(
    answers: Callable[..., Endpoint], status: int, wait_s: float, limit_s: float
) -> None:
    given = answers(chat(json.dumps(GOOD)), status, wait_s, limit_s).readings("park behind the red car")
    assert "was not heard" in given[0].notes[-1]


def test_one_that_sends_a_byte_now_and_then_is_not_waited_for() -> None:
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
    given = Endpoint(f"http://127.0.0.1:{server.getsockname()[1]}/", "m", None, 0.2).readings("stop")
    assert given[0].notes[-1] == "the language model was not heard: no answer within 0.2 s"
    assert dripping.is_alive()
    ended.set()
    dripping.join(10)
    server.close()


def test_an_answer_too_deep_is_not_heard(answers: Callable[..., Endpoint]) -> None:
    assert "was not heard" in answers(b"[" * 50_000).readings("stop")[0].notes[-1]


def test_one_that_is_not_there() -> None:
    given = Endpoint("http://127.0.0.1:9/", "m", None, 0.5).readings("stop")
    assert given[0].query == read("stop").query
    assert "was not heard" in given[0].notes[-1]


def test_what_it_rejects_the_grammar_may_still_read(answers: Callable[..., Endpoint]) -> None:
    given = answers(chat('{"status": "reject"}')).readings("park behind the red car")
    assert given[0].query == read("park behind the red car").query


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
def test_addresses_of_nothing(url: str) -> None:
    with pytest.raises(DataError, match="expected an address that begins with http"):
        Endpoint(url, "m")
