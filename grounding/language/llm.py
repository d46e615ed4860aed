"""A language model beside the grammar, for those who have one: it must answer with the same query, or is not heard.

Off unless asked for. It speaks the chat protocol that most servers share (POST of messages, an answer in
`choices[0].message.content`); the sentence is all that leaves the machine. What comes back is checked value by value;
if it does not come in time, or is no query, the grammar's reading stands.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from http.client import HTTPException
from threading import Thread
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from appocc.errors import DataError
from grounding.language.parser import Reading, readings
from grounding.language.word_categories import Action, Relation
from grounding.query import Placement
from grounding.query_schema import Noun, Qualifier, choices, query_from_json

_MOST_BYTES, _MOST_TOLD = 100_000, 200
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
class Endpoint:
    """Where a language model answers.

    Attributes:
        url: of its chat completions, http or https.
        model: its name.
        key: sent as a bearer token, None where none is needed.
        timeout_s: how long an answer may take in all.
        read: how sentences are read beside it.
    """

    url: str
    model: str
    key: str | None = None
    timeout_s: float = 5.0
    read: Callable[[str], tuple[Reading, ...]] = readings

    def __post_init__(self) -> None:
        """Check the address.

        Raises:
            DataError: if it is not one of http or https.
        """
        try:
            parts = urlsplit(self.url)
            good = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
        except ValueError:  # half an IPv6 address, a port that is none
            good = False
        if not good:
            raise DataError(
                f"language model: expected an address that begins with http:// or https://, got {self.url}"
            )

    def readings(self, text: str) -> tuple[Reading, ...]:
        """The model's reading before those of the grammar; if it fails, those of the grammar with a note why."""
        own = self.read(text)
        try:
            query = query_from_json(text, json.loads(_within(self.timeout_s, partial(self._asked, text))))
        except (DataError, ValueError, OSError, HTTPException, RecursionError) as error:
            note = f"the language model was not heard: {str(error)[:_MOST_TOLD]}"
            return tuple(replace(one, notes=(*one.notes, note)) for one in own)
        if query.action is None:
            return own
        return (Reading(query, 0.0, own[0].tokens, ("read by the language model",)), *own)

    def _asked(self, text: str) -> str:
        """What the model answers to a sentence.

        Raises:
            OSError: if the endpoint is not there or too slow.
            DataError: if the answer is not of the protocol.
        """
        messages = [{"role": "system", "content": _TASK}, {"role": "user", "content": text}]
        body = {"model": self.model, "messages": messages, "temperature": 0}
        headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {self.key}"} if self.key else {})
        request = Request(self.url, json.dumps(body).encode(), headers)
        try:
            with urlopen(request, timeout=self.timeout_s) as answer:
                return _content(json.loads(answer.read(_MOST_BYTES)))
        except HTTPError as error:
            error.close()  # it holds the connection
            raise


def _within(seconds: float, job: Callable[[], str]) -> str:
    """What a job returns or raises; one that takes longer is left to itself, and ends with the process at the latest.

    A limit for each read is none for all: a server may send a byte a second.

    Raises:
        TimeoutError: if it takes longer.
    """
    answer: Future[str] = Future()

    def work() -> None:
        try:
            answer.set_result(job())
        except Exception as error:  # whatever it is, it is raised where the answer is waited for
            answer.set_exception(error)

    Thread(target=work, daemon=True).start()
    try:
        return answer.result(seconds)
    except TimeoutError as error:
        raise TimeoutError(f"no answer within {seconds:g} s") from error


def _content(answer: Any) -> str:
    """The text of an answer.

    Raises:
        DataError: if there is none.
    """
    try:
        content = answer["choices"][0]["message"]["content"]
    except (KeyError, IndexError, TypeError) as error:
        raise DataError("expected an answer with choices[0].message.content") from error
    if not isinstance(content, str):
        raise DataError(f"expected a text as the answer, got {type(content).__name__}")
    # Some put their JSON between fences.
    return content[content.find("{") : content.rfind("}") + 1]
