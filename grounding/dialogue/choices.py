"""Replies that choose: a number, "yes", "no", "the other one"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from grounding.answer import Answer
from grounding.answering import accept_proposal, without
from grounding.describe import describe_object
from grounding.dialogue.clauses import clauses_of, is_phrase, says
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import any_of, find_fitting, reading_of, without_qualifiers
from grounding.dialogue.telling.measures import gap_ends_m
from grounding.dialogue.telling.phrases import ask, said
from grounding.dialogue.telling.reports import ask_again, cancel, inform, keep, not_understood
from grounding.query import Referent
from grounding.referent.resolver import Candidate, resolve
from grounding.requests import Request
from grounding.road.lane_model import LANE_M


def choose_number(talk: Conversation, text: str, number: int) -> Answer:
    """Take a candidate, or a reading, by its number; -1 is the last candidate."""
    about, request = talk.state.question or talk.state.goal, talk.state.request
    if about is not None and number < 0:
        number += len(about.candidates) + 1
    if about is not None and 1 <= number <= len(about.alternatives):
        return talk.take_reading(about.alternatives[number - 1])
    if about is None or request is None or not 1 <= number <= len(about.candidates):
        return ask_again(talk, text)
    return talk.choose(about.candidates[number - 1], request, text)


def confirm(talk: Conversation, text: str) -> Answer:
    """Take the only candidate of the open question, or the nearest place if that was offered."""
    question, request = talk.state.question, talk.state.request
    if question is None or request is None:
        if talk.state.goal is None and talk.state.earlier and says("afterall", text):
            return go_back(talk, text)  # "never mind". "Do it after all"
        return inform(talk, text, "the goal stays as it is") if talk.state.goal else keep(talk, text)
    if len(question.alternatives) == 1:
        return talk.take_reading(question.alternatives[0])
    if question.plan.question:
        accepted = accept_proposal(request, question)
        accepted = replace(accepted, reading=said(accepted.reading, text))
        return talk.take(talk.state.with_request(accepted))
    if len(question.candidates) == 1:
        return talk.choose(question.candidates[0], request, text)
    return ask_again(talk, text)


def name_followed(talk: Conversation, text: str) -> Answer | None:
    """Take the candidate that was followed, or tell which vehicle that was; None for other turns.

    "The one we were following".
    """
    clauses = clauses_of(talk, text)
    if len(clauses) != 1 or not is_phrase("followed", clauses[0]):
        return None
    plans = (talk.state.plan, *talk.state.earlier)
    followed = [step for plan in plans for step in plan if step.query.action == "follow" and step.chosen is not None]
    if not followed or (vehicle := followed[0].chosen) is None:
        return None
    if talk.state.lists and talk.state.request is not None:
        return talk.choose(vehicle, talk.state.request, text)
    talk.state = replace(talk.state, focus=(vehicle, followed[0].query.referent or Referent("vehicle", "one")))
    return inform(talk, text, f"that was the {describe_object(vehicle.item, talk.scene)}")


def take_any(talk: Conversation, text: str) -> Answer:
    """Take a candidate of the open question that has a place: "whichever is easier"."""
    question, request = talk.state.question, talk.state.request
    if question is None or request is None or not question.candidates:
        return confirm(talk, text)
    return take_best(talk, question.candidates, replace(request, reading=said(request.reading, text)))


def take_roomiest(talk: Conversation, text: str) -> Answer:
    """Take the candidate of the open question at which there is most room: "whichever has more space behind it"."""
    question, request = talk.state.question, talk.state.request
    if question is None or request is None or len(question.candidates) < 2:
        return take_any(talk, text)
    request = replace(request, reading=said(request.reading, text))
    ordered = _ours_first(talk, question.candidates)
    targets = [_goal_at(talk, one, request).target for one in ordered]
    rooms = [sum(gap_ends_m(one, talk.scene)) if one is not None else -1.0 for one in targets]
    answer = talk.choose(ordered[rooms.index(max(rooms))], request)
    reason = f"of the {len(rooms)} it has most room" if max(rooms) >= 0 else "there is room at none of them"
    return replace(answer, reasons=(reason, *answer.reasons))


def take_best(talk: Conversation, candidates: Sequence[Candidate], request: Request) -> Answer:
    """Take one of several candidates that will do: one with a place, on our side if there is one."""
    ordered = _ours_first(talk, candidates)
    placed = (one for one in ordered if _goal_at(talk, one, request).status == "ok")
    return talk.choose(next(placed, ordered[0]), request)


def _ours_first(talk: Conversation, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates with those first that are on our side of the road."""
    on_our_side = reading_of(Referent("vehicle", "one", qualifiers=("own_side",), anaphora=True))
    ours = find_fitting(on_our_side, candidates, talk.scene)
    return [*ours, *(one for one in candidates if one not in ours)]


def _goal_at(talk: Conversation, candidate: Candidate, request: Request) -> Answer:
    """Return the answer to a step if a candidate is meant."""
    return talk.answer_steps(talk.state.with_request(replace(request, chosen=candidate)), talk.state.at)


def go_back(talk: Conversation, text: str, described: Referent | None = None, number: int | None = None) -> Answer:
    """Put the plan in force that was so before the last one, or that was about a vehicle: "back to the red one".

    Args:
        talk: the conversation.
        text: the sentence.
        described: the vehicle; None without one.
        number: 1 for the first plan of all.
    """
    if not talk.state.earlier:
        return inform(talk, text, "no other command was given before")
    is_first = number == 1 and (described is None or described.colour is None)
    before, *earlier = talk.state.earlier[-1:] if is_first else talk.state.earlier[_index_of(talk, described) :]
    answer = talk.take_steps(text, before)
    if earlier:  # the next "undo" goes back farther; at the first plan it puts the last one in force again
        talk.state = replace(talk.state, earlier=tuple(earlier))
    return answer


def returns_to_first(talk: Conversation, text: str) -> bool:
    """Return whether "the first one after all" is the first plan, and none of several vehicles on offer."""
    return says("afterall", text) and bool(talk.state.earlier) and len(talk.state.offered) < 2


def _index_of(talk: Conversation, described: Referent | None) -> int:
    """Return the number of the last earlier plan that was about a vehicle as described."""
    earlier = talk.state.earlier
    if described is None:
        return 0
    about = [next((step.chosen for step in reversed(plan) if step.chosen), None) for plan in earlier]
    fitting = find_fitting(reading_of(described), [one for one in about if one is not None], talk.scene)
    ids = {one.item.id for one in fitting}
    return next((i for i, one in enumerate(about) if one is not None and one.item.id in ids), 0)


def refuse(talk: Conversation, text: str) -> Answer:
    """Drop the open question; without one, take another one of those that were offered, or ask what to do."""
    if talk.state.question is None:
        several = len(talk.state.offered) > 1
        return take_other(talk, text) if several else inform(talk, text, "the goal stays: say what to do instead")
    talk.state = replace(talk.state, question=None)
    return inform(talk, text, "then nothing is changed: say what to do instead")


def choose_offered(talk: Conversation, text: str, index: int) -> Answer:
    """Take the first or the last candidate that was offered: "the former", "the latter"."""
    request, offered = talk.state.request, talk.state.offered
    if request is None or not offered:
        return ask_again(talk, text)
    return talk.choose(offered[index], request, text)


def choose_middle(talk: Conversation, text: str) -> Answer:
    """Take the middle one of the candidates along our way; of all that fit, if the offered have no middle."""
    request, question = talk.state.request, talk.state.question
    goal = talk.state.goal
    offered = question.candidates if question is not None else goal.candidates if goal is not None else ()
    if request is None or not offered:
        return ask_again(talk, text)
    if _has_no_middle(offered) and request.query.referent is not None:
        plain = replace(request.query, referent=replace(request.query.referent, qualifiers=()))
        offered = resolve(any_of(plain), talk.scene).candidates
    if _has_no_middle(offered):
        return ask_again(talk, text)
    row = sorted(offered, key=lambda one: float(talk.scene.lanes.project(one.item.centre_m[None])[0][0]))
    return talk.choose(row[len(row) // 2], request, text)


def _has_no_middle(row: Sequence[Candidate]) -> bool:
    return len(row) % 2 == 0 or len(row) < 3


def take_next(talk: Conversation, text: str, sign: float) -> Answer:
    """Take the next vehicle of the same kind in its line along our way (sign -1: the one before): "one further".

    After a car it may be of any kind; a row of standing vehicles has no moving ones.
    """
    request, last = talk.state.request, talk.meant
    if request is None or request.query.referent is None or last is None:
        return take_other(talk, text)
    before = request.query.referent
    sought = Referent("vehicle" if before.noun == "car" else before.noun, before.head, definite=False)
    query = replace(request.query, command=text, referent=sought, secondary=(), excluded=())
    request = Request(reading=request.reading.with_query(query))
    found = resolve(query, without(talk.scene, frozenset({last.item.id})))
    places = np.array([one.item.centre_m for one in found.candidates] or np.empty((0, 2)))
    along, lateral = np.array(talk.scene.lanes.project(places)) - np.array(
        talk.scene.lanes.project(last.item.centre_m[None])
    )
    in_row = [one.item.is_standing or not last.item.is_standing for one in found.candidates]
    in_line = (sign * along > 0) & (np.abs(lateral) < LANE_M / 2) & np.array(in_row, dtype=bool)
    beyond = np.where(in_line, sign * along, np.inf)
    if not np.isfinite(beyond).any():
        where = "further on" if sign > 0 else "before it"
        return inform(talk, text, f"no other {before.head} is {where}")
    following = found.candidates[int(np.argmin(beyond))]
    if before.noun not in ("vehicle", following.item.common_name):  # the truck after a car
        called = replace(query, referent=replace(sought, head="vehicle"))
        request = Request(reading=request.reading.with_query(called))
    return talk.choose(following, request)


def take_none(talk: Conversation, text: str) -> Answer:
    """Ask about the vehicles that were not offered, or drop the goal where nothing is asked: "neither"."""
    state, request = talk.state, talk.state.request
    if state.question is None:
        return cancel(talk, text)
    if request is None or len(state.question.candidates) < 2:
        return take_other(talk, text)
    rejected = state.rejected | {one.item.id for one in state.question.candidates}
    talk.state = replace(state, rejected=rejected)
    found = resolve(request.query, without(talk.scene, rejected))
    left = found.candidates if found.status == "ambiguous" else found.candidates[: found.status == "ok"]
    if not left:
        reason = f"none of these {len(state.question.candidates)} then: which vehicle is meant?"
        return replace(ask_again(talk, text), reasons=(reason,))
    asked = ask(left, said(request.reading, text), talk.scene)
    asked = replace(asked, reasons=(f"none of these {len(state.question.candidates)} then",))
    return talk.settle(talk.state.with_request(request), asked)


def take_other(talk: Conversation, text: str) -> Answer:
    """Take the remaining candidate, ask among the remaining ones, or look for another one."""
    state, request = talk.state, talk.state.request
    sought = request.query.referent if request is not None else None
    if request is None or sought is None:
        return not_understood(talk, text, talk.read(text))
    refused = {one.item.id for one in state.question.candidates[:1]} if state.question else set[str]()
    if state.question is None and request.chosen is not None:
        refused = {request.chosen.item.id}
    rejected = state.rejected | refused
    if rejected >= {one.item.id for one in state.offered}:
        rejected = frozenset(refused)  # after all were refused, the others are meant again
    talk.state = replace(state, rejected=rejected, question=None)
    request = replace(request, chosen=None, shifts=(), reading=said(request.reading, text))
    left = [one for one in state.offered if one.item.id not in rejected]
    if len(state.offered) > 1 and left:
        return talk.narrow(left, request)
    plain = without_qualifiers(request)
    before = [one for one in state.spoken if one.item.id not in rejected]
    if known := find_fitting(reading_of(replace(sought, qualifiers=())), before, talk.scene):
        return talk.choose(known[0], plain)
    for wanted in (request, plain):
        found = resolve(wanted.query, without(talk.scene, rejected))
        if found.status == "ok" and found.candidates:
            return talk.choose(found.candidates[0], wanted)
        if found.status == "ambiguous":
            return talk.narrow(found.candidates, wanted)
    named = request.query.referent.phrase() if request.query.referent else "vehicle"
    reason = f"no other vehicle here fits '{named}'"
    answer = Answer(status="not_found", reading=request.reading, scene=talk.scene, reasons=(reason,))
    return talk.settle(talk.state.with_request(request), answer)
