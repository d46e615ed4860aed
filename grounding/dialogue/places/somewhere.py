"""Turns that ask for a place of any kind, or for one ahead of us: "what about somewhere ahead?", "not backwards"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.dialogue.clauses import Words, clauses_of, is_phrase
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.places.shifts import BIT_M, move_elsewhere, shift_last
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import inform
from grounding.goal.ego_lane import gap_number
from grounding.goal.second_best import asks_for_kerb
from grounding.goal.shift import Shift
from grounding.language import Reading
from grounding.language.replies import read_reply, words_end
from grounding.query import Query
from grounding.requests import STOPS, Request
from grounding.vocabulary import ShiftDirection

# Actions of a stop that is at the edge of the road if no vehicle is named.
_AT_EDGE = ("park", "pull_over")
# Words for a place beyond the goal in force, and where it is looked for.
_FURTHER = frozenset(("further", "farther"))
# Most words of a clause beside one that seeks room: "no, not in the street".
_FEW = 5
_AHEAD: tuple[ShiftDirection, ...] = ("ahead",)


def answer_somewhere(talk: Conversation, text: str) -> Answer | None:
    """Answer a turn that gives up the place for any other one, ahead of us if that is said; None for other turns."""
    state, request = talk.state, talk.state.request
    clauses = clauses_of(talk, text)
    if request is not None and (answer := _drive_on_for_room(talk, text, request, clauses)):
        return answer
    if request is None or state.lists or not (request.query.action in STOPS and state.steps):
        return None
    if clauses and all(is_phrase("nextgap", words) or is_phrase("thatgap", words) for words in clauses):
        return _take_next_gap(talk, text, request)
    asks = [_asks_anywhere(words) for words in clauses]
    refused = [is_phrase("notback", words) for words in clauses]
    others = [words for words, *told in zip(clauses, asks, refused, strict=True) if not any(told)]
    others = [words for words in others if read_reply(" ".join(words)).kinds[-1:] != ("elsewhere",)]  # "not there"
    if any(refused):  # "I don't want to back up. Anything in front?"
        asks += [words_end("anyplace", words, 0) > 0 for words in others]
        others = [words[words_end("anyplace", words, 0) :] for words in others]
    if not clauses or not all(is_phrase("upahead", words) for words in others):
        return None
    if any(asks):
        beyond = any(_FURTHER & {*words} for words in clauses)
        return _take_any_ahead(talk, text) if _is_behind(talk) or not beyond else move_elsewhere(talk, text, _AHEAD)
    if any(refused):
        repeats = "meant" in read_reply(text, talk.grounder.lexicon).kinds
        return _avoid_reversing(talk, text, said_ahead=any(map(_says_ahead, clauses)), repeats=repeats)
    of_us = all("us" in words for words in others)  # "no, in front of us"
    return _take_any_ahead(talk, text) if of_us and _is_behind(talk) else None


def _drive_on_for_room(talk: Conversation, text: str, request: Request, clauses: Sequence[Words]) -> Answer | None:
    """Drive on until the edge of the road has room, where our lane is offered instead; None for other turns."""
    question = talk.state.question
    seeks = [is_phrase("forroom", words) for words in clauses]
    counts = any(is_phrase("nextgap", words) for words in clauses)
    if question is None and seeks and all(seeks) and not counts and request.query.action in STOPS:
        kerb = Query(text, "pull_over", ("pull_over",), manoeuvre="onward")  # "then the first gap you can find"
        return talk.take([Request(reading=said(request.reading.with_query(kerb), text))])
    if question is None or not question.plan.question or not asks_for_kerb(request.query):
        return None
    others = [words for words, seeks_room in zip(clauses, seeks, strict=True) if not seeks_room]
    others = [words for words in others if talk.read(" ".join(words)).query.manoeuvre != "onward"]
    if len(others) == len(clauses) or any(len(words) > _FEW for words in others):
        return None
    onward = replace(request.query, manoeuvre="onward")
    reading = said(request.reading.with_query(onward), text)
    return talk.take(talk.state.with_request(replace(request, reading=reading)))


def _take_next_gap(talk: Conversation, text: str, request: Request) -> Answer | None:
    """Move a goal at the edge of the road to the gap after it; None for a goal that is measured from something."""
    query, goal, road = request.query, talk.state.goal, talk.scene.road
    measured = query.referent is not None or query.secondary
    if query.action not in _AT_EDGE or measured or road is None or goal is None or goal.target is None:
        return None
    side = query.on_side(road.traffic_side).goal_side or "right"  # as it is proposed
    counted = replace(query, count=gap_number(road, side, goal.target.cell) + 1)
    moved = Request(reading=said(request.reading.with_query(counted), text))
    steps = talk.state.with_request(moved)
    answer = talk.answer_steps(steps)
    if answer.status != "ok":
        return inform(talk, text, f"the goal stays as it is: {answer.reasons[-1]}")
    return talk.take(steps, answer=answer)


def after_someplace(words: Words) -> Words:
    """Return the words that say where a place of any kind is: "find somewhere behind the van"."""
    return words[words_end("someplace", words, 0) :]


def _asks_anywhere(words: Words) -> bool:
    """Return whether a clause asks for any place, or for any ahead of us."""
    where = after_someplace(words)
    return where != words and (not where or is_phrase("upahead", where))


def _says_ahead(words: Words) -> bool:
    return words_end("upahead", words, 0) > 0


def _is_behind(talk: Conversation) -> bool:
    """Return whether the place that is asked about, or in force, is behind us."""
    about = talk.state.question or talk.state.goal
    target = (about.target or about.plan.nearest) if about is not None else None
    return target is not None and bool(target.ego_m[0] < talk.scene.ego.centre_m)


def _take_any_ahead(talk: Conversation, text: str) -> Answer:
    """Plan the action of the last command at any place ahead of us."""
    request = talk.state.request
    action = request.query.action if request is not None else None
    kept = action if action in _AT_EDGE or action == "stop" else "pull_over"
    side = request.query.goal_side if request is not None else None
    query = Query(text, kept, (kept,), goal_side=side)
    return talk.take(talk.state.with_request(Request(reading=Reading(query))))


def _avoid_reversing(talk: Conversation, text: str, *, said_ahead: bool, repeats: bool) -> Answer:
    """Give up a place behind us for any ahead; where the goal is ahead, move it on, or keep it if it is not said."""
    request = talk.state.request
    moved_back = request is not None and any(one.direction == "back" for one in request.shifts[-1:])
    if _is_behind(talk) or talk.state.goal is None:
        return _take_any_ahead(talk, text)
    if said_ahead and request is not None and moved_back:  # "a bit further". "I said ahead, not back"
        talk.state = replace(talk.state, plan=talk.state.with_request(replace(request, shifts=request.shifts[:-1])))
        return shift_last(talk, text, replace(request.shifts[-1], direction="ahead"))
    if said_ahead and not repeats:
        return shift_last(talk, text, Shift("ahead", BIT_M))
    told = "it is ahead of us" if said_ahead else "say where else, if the way there is not to be reversed"
    return inform(talk, text, f"the goal stays as it is: {told}")
