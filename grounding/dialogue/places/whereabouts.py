"""Turns that say where somebody is: a person who waits for us at a vehicle, and places between two vehicles.

Both vehicles are those that the last answer named.
"""

from __future__ import annotations

import re

from grounding.answer import Answer
from grounding.dialogue.commands import answer_command
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import begins_with_place, is_understood
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.things import find_told
from grounding.referent.resolver import Candidate
from grounding.requests import STOPS, requests_of

# Who is somewhere, and how: "he's standing by the yellow car".
_WHO_IS = re.compile(
    r"^(?:(?:ok|okay|and|well|oh|no|actually|sorry|look)[, ]+)*(?:he|she|they|i|we)(?:'s|'re|'m| is| are| am)"
    r"(?: (?:standing|waiting|sitting|parked|just|right|over there|there|now))* ",
    re.IGNORECASE,
)
# Both of two things that were told.
_THE_TWO = re.compile(r"\bbetween (?:the two|them|those two|these two|the two of them|both)\b", re.IGNORECASE)


def answer_whereabouts(talk: Conversation, text: str) -> Answer | None:
    """Stop where somebody is said to be, once a stop is asked for or in force; None for other turns."""
    request, who = talk.state.request, _WHO_IS.match(text)
    if request is None or who is None or request.query.action not in STOPS:
        return None
    named = request.query.referent
    if named is not None and named.noun != "person":
        return None
    if not begins_with_place(text[who.end() :], talk.readings):
        return None  # "he's the one further away"
    command = f"{(request.query.action or 'stop').replace('_', ' ')} {text[who.end() :]}"
    reading = talk.readings(command, alone=False)[0]
    placed = reading.query.relation != "none" and reading.query.landmark is not None
    return answer_command(talk, text, command) if placed and is_understood(reading) else None


def answer_between_told(talk: Conversation, text: str) -> Answer | None:
    """Take a place between the two vehicles that the last answer told: "stop between the two"; None for others."""
    told = find_told(talk)
    if len(told) != 2 or not _THE_TWO.search(text):
        return None
    reading = talk.readings(_THE_TWO.sub("between the two vehicles", text), alone=False)[0]
    if reading.query.relation != "between" or reading.query.action is None:
        return None
    pair = Candidate(told[0].item, told[0].fits, told[0].score, told[1].item)
    (request,) = requests_of(said(reading, text))[:1]
    return talk.choose(pair, request, text)
