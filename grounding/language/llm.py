"""Second reading of a sentence by a language model; off by default.

Protocol: chat completions (POST of messages, the answer in `choices[0].message.content`). Only the sentence leaves
the machine. The answer is validated value by value.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from http.client import HTTPException
from threading import Thread
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from appocc.errors import DataError
from grounding.language.problems import ParseProblem
from grounding.language.reading import Reading
from grounding.query import Placement
from grounding.query_schema import Noun, Qualifier, choices, query_from_json
from grounding.vocabulary import Action, Relation

_MAX_BYTES, _MAX_ERROR_CHARACTERS = 100_000, 200
_TASK = f"""You read what a passenger tells a self-driving car and answer with one JSON object and nothing else.
status: "ok", or "reject" if it is no driving command (then nothing else).
action: the action that takes the vehicle referred to, else the main one: {choices(Action)}.
actions: all of them in order. direction: left, right, around, straight or null.
relation: where the car ends relative to the landmark: {choices(Relation)}.
landmark: "referent", "secondary" (the first of them) or null. goal_side: side of the road for the goal, or null.
referent: the vehicle, or null: noun ({choices(Noun)}), head (the word used), colour (as said, grey for gray),
qualifiers ({choices(Qualifier)}), number (2 for "the two cars").
secondary: further things: noun, relation (also {choices(Placement)}), of ("goal", "referent", or "inverse"), colour,
qualifiers. trigger: pass, leave, turn, stop, merge, clear, other or null. distance_m and distance_of ("referent": gap
to it, "ego": way to go, "descriptor": it is that far away), or null.
excluded: what is ruled out: relation (null: no such vehicle is meant), noun, colour, qualifiers."""


@dataclass(frozen=True)
class ChatEndpoint:
    """Chat-completions endpoint of a language model.

    Attributes:
        url: address of the chat completions, http or https.
        model: model name.
        key: bearer token, None if the endpoint needs none.
        timeout_s: time limit of an answer in seconds, for connection and transfer together.
    """

    url: str
    model: str
    key: str | None = None
    timeout_s: float = 5.0

    def __post_init__(self) -> None:
        """Check the address.

        Raises:
            DataError: if the address is not a valid http or https address.
        """
        try:
            parts = urlsplit(self.url)
            good = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
        except ValueError:  # incomplete IPv6 address, invalid port
            good = False
        if not good:
            raise DataError(
                f"language model: expected an address that begins with http:// or https://, got {self.url}"
            )

    def read(self, text: str) -> Reading:
        """Return the model's reading of a sentence, with a problem if the model takes it for no command.

        Raises:
            DataError: if the model cannot be reached, is too slow, or its answer is no valid query.
        """
        try:
            query = query_from_json(text, json.loads(_run_with_timeout(self.timeout_s, partial(self._request, text))))
        except (DataError, ValueError, OSError, HTTPException, RecursionError) as error:
            raise DataError(f"the language model was not used: {str(error)[:_MAX_ERROR_CHARACTERS]}") from error
        problem = None if query.action else ParseProblem("the language model takes it for no driving command")
        return Reading(query, notes=("read by the language model",), problem=problem)

    def _request(self, text: str) -> str:
        """Return the model's answer to a sentence.

        Raises:
            OSError: if the endpoint cannot be reached or is too slow.
            DataError: if the answer does not follow the protocol.
        """
        messages = [{"role": "system", "content": _TASK}, {"role": "user", "content": text}]
        body = {"model": self.model, "messages": messages, "temperature": 0}
        headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {self.key}"} if self.key else {})
        request = Request(self.url, json.dumps(body).encode(), headers)
        try:
            with urlopen(request, timeout=self.timeout_s) as answer:
                return _content(json.loads(answer.read(_MAX_BYTES)))
        except HTTPError as error:
            error.close()  # the error holds the connection
            raise


def _run_with_timeout(seconds: float, job: Callable[[], str]) -> str:
    """Return or raise the result of a job; a job that takes longer continues in a daemon thread.

    A timeout per read does not bound the total time: a server may send one byte a second.

    Raises:
        TimeoutError: if the job takes longer.
    """
    answer: Future[str] = Future()

    def work() -> None:
        try:
            answer.set_result(job())
        except Exception as error:  # raised again in the waiting thread
            answer.set_exception(error)

    Thread(target=work, daemon=True).start()
    try:
        return answer.result(seconds)
    except TimeoutError as error:
        raise TimeoutError(f"no answer within {seconds:g} s") from error


def _content(answer: Any) -> str:
    """Return the JSON text of an answer.

    Raises:
        DataError: if the answer has no text.
    """
    try:
        content = answer["choices"][0]["message"]["content"]
    except (KeyError, IndexError, TypeError) as error:
        raise DataError("expected an answer with choices[0].message.content") from error
    if not isinstance(content, str):
        raise DataError(f"expected a text as the answer, got {type(content).__name__}")
    # Some models put their JSON in a code fence.
    return content[content.find("{") : content.rfind("}") + 1]
