"""Replies that change the last command: another vehicle, relation or side, a shifted goal, fewer steps."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.answering import without
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import any_of, find_at_distance, find_beside, find_fitting, reading_of, widen
from grounding.dialogue.fragments import (
    begins_with_place,
    complete,
    describe_and_place,
    names_pronoun,
    names_vehicle,
    read_description,
    turn_neighbours,
)
from grounding.dialogue.merging import merge_request
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import cancel, inform
from grounding.dialogue.turns import Turn
from grounding.language import Reading, WordCategory
from grounding.language.reader.fields import unlearnt_qualifiers
from grounding.language.replies import Reply, named_distance
from grounding.language.revised_readings import evidence_of
from grounding.query import Query, Referent
from grounding.referent.ordinals import find_ordinals
from grounding.referent.predicates import to_referent
from grounding.referent.resolver import Candidate, resolve
from grounding.requests import Request
from grounding.vocabulary import Action, ShiftDirection

# Questions about somebody or something that was not spoken of.
_WHO_OR_WHAT = re.compile(r"(?:and |oh |but |so )*(?:(?P<who>who)|what)(?:'s| is|s) (?:the|that|this)\b")

# Moves to a side.
_SIDEWAYS: Mapping[str, ShiftDirection] = {"left": "leftwards", "right": "rightwards"}


def answer_fragment(talk: Conversation, text: str, reply: Reply, turn: Turn | None = None) -> Answer | None:
    """Answer a sentence without a verb: a description, or another relation; None if it is neither.

    What the grammar does not find in it is taken from `turn`, if that is given.
    """
    state, request = talk.state, talk.state.request
    if request is None:
        return None
    if turn is not None and (told := _told_apart(talk, reply, turn)):
        return talk.narrow(told, replace(request, reading=said(request.reading, text)))
    if turn is not None and state.question is None and (without := turn.without_place(text, talk.antecedent)):
        return talk.take(state.with_request(merge_request(request, without)))
    base = request.query
    antecedent = talk.antecedent or (None if base.referent else Referent("vehicle", "one"))
    if turn is not None and turn.act in ("place", "describe") and turn.is_plain:
        named = _beside_another(talk, reply, turn, base) or _place_of(talk, text, reply, turn, None)
        return _replace(talk, text, named, request) if named is not None else None
    only_places = turn is not None and turn.act == "place" and turn.described(None) is None
    if not only_places and (both := describe_and_place(reply.rest, base, antecedent, talk.readings)):
        return _replace(talk, text, both, request)
    describes = turn is not None and turn.act == "describe" and turn.relation == "none"
    describes = describes and not begins_with_place(reply.rest, talk.readings)  # "behind the beige one would do"
    # A relation in a mere description is that of a neighbour, or the grammar's mistake.
    reading = None if describes else complete(reply.rest, base, antecedent, talk.readings)
    if reading is not None and talk.antecedent is None and names_pronoun(reading):
        reading = complete(reply.rest, base, None, talk.readings)  # "it" refers to nothing yet
    place = _place_of(talk, text, reply, turn, reading)
    if place is not None and place.query.referent is not None and turn is not None and turn.names_vehicle:
        return _replace(talk, text, place, request)
    reading = place or reading
    placed = reading is not None and (
        reading.query.relation != "none" or bool(base.direction and reading.query.direction)
    )
    if state.question is not None and reading is not None and placed and _places_one(talk, reply.rest, reading):
        return _replace(talk, text, reading, request)  # "behind the beige one"
    # "No, behind the lorry" is no answer, nor "in front of it then" where one vehicle is asked about.
    of_it = not state.lists and reading is not None and names_pronoun(reading)
    answers = state.question is not None and not (placed and ("no" in reply.kinds or of_it))
    if answers and (answer := _answer_description(talk, text, reply, state.question, turn)):
        return answer
    places = placed or (turn is not None and turn.act == "place")
    if reading is not None and (places or base.referent is None):
        return _modify(talk, said(widen(reading, talk.scene), text), request)
    if answer := _answer_description(talk, text, reply, None, turn):
        return answer
    if reading is not None:
        return _modify(talk, said(reading, text), request)
    return None


def _told_apart(talk: Conversation, reply: Reply, turn: Turn) -> list[Candidate]:
    """Return the candidates that are told by their distance, or those of a question by a neighbour; else none."""
    question = talk.state.question
    if turn.act != "describe":
        return []
    distance_m = named_distance(reply.rest, talk.grounder.lexicon)
    spoken_of = talk.antecedent
    plain = Referent(spoken_of.noun, spoken_of.head) if spoken_of is not None else None
    if question is None and distance_m is not None and (named := turn.described(plain)):
        every = resolve(any_of(Query("", referent=replace(named, qualifiers=()))), talk.scene).candidates
        return find_at_distance(distance_m, every, talk.scene)  # "no, the one about 25 metres ahead"
    if question is None or len(question.candidates) < 2:
        return []
    if distance_m is not None:
        return find_at_distance(distance_m, question.candidates, talk.scene)
    reading = read_description(reply.rest, talk.antecedent, talk.readings)
    # Of a neighbour more may be said than is understood: "nearer the old fella on the footpath".
    reading = reading or talk.readings(f"follow {turn_neighbours(reply.rest)}", talk.antecedent)[0]
    known = [one for one in reading.query.secondary if one.of == "referent"]
    beside: list[tuple[Referent, str]] = [(to_referent(one), one.relation) for one in known]
    if not beside and (named := turn.described(None)) and turn.relation != "none":
        beside = [(named, turn.relation)]
    found = (find_beside(*one, question.candidates, talk.scene) for one in beside)
    return next(filter(None, found), [])


def _place_of(
    talk: Conversation, text: str, reply: Reply, turn: Turn | None, reading: Reading | None
) -> Reading | None:
    """Return the place, and its vehicle, that the reader of turns finds; None where the grammar's counts more."""
    if turn is None or not (turn.act == "place" or (turn.act == "describe" and turn.relation != "none")):
        return None
    place = turn.placed(text, talk.antecedent) if turn.replaces(reading) else None
    if place is None:
        return None
    described = read_description(reply.rest, talk.antecedent, talk.readings) if place.referent is None else None
    if described is not None and names_vehicle(described):
        place = replace(place, referent=described.query.referent)
    return Reading(place)


def _beside_another(talk: Conversation, reply: Reply, turn: Turn, base: Query) -> Reading | None:
    """Return the grammar's place at a vehicle that is told by its neighbour: "behind the first car after it".

    None where the reader of turns, which knows no neighbours, finds another place, or another vehicle.
    """
    reading, named = complete(reply.rest, base, talk.antecedent, talk.readings, whole=True), turn.described(None)
    own = reading.query.referent if reading is not None else None
    if reading is None or own is None or named is None or reading.query.relation != turn.relation:
        return None
    beside = any(one.of == "referent" for one in reading.query.secondary)
    return reading if beside and (own.noun, own.colour) == (named.noun, named.colour) else None


def _places_one(talk: Conversation, words: str, reading: Reading) -> bool:
    """Return whether a fragment begins with a place that is measured from a vehicle it describes."""
    query = reading.query
    named = query.referent is not None and query.landmark == "referent" and not names_pronoun(reading)
    return named and begins_with_place(words, talk.readings)


def _replace(talk: Conversation, text: str, reading: Reading, request: Request) -> Answer:
    """Plan the last command with another vehicle and another place."""
    question = talk.state.question
    changed = merge_request(request, said(widen(reading, talk.scene), text).query)
    if question is not None and (fitting := find_fitting(reading, question.candidates, talk.scene)):
        return talk.narrow(fitting, changed)
    return _take_changed(talk, changed, reading.query)


def _answer_description(
    talk: Conversation, text: str, reply: Reply, question: Answer | None, turn: Turn | None
) -> Answer | None:
    """Answer the description of a vehicle: one of the candidates of a question, else any vehicle of the scene."""
    request = talk.state.request
    reading = read_description(reply.rest, talk.antecedent, talk.readings, whole=True)
    told = _likeliest(talk, turn) if turn is not None and turn.act == "describe" else None
    if told is not None and (reading is None or _is_simple(reading) or _is_neighbour(talk, reading, told)):
        reading = _with_own_words(told, reading)  # only the grammar knows neighbours, and what is not meant
    reading = reading or read_description(reply.rest, talk.antecedent, talk.readings)
    if question is not None and (answer := refuse_described(talk, text, reply.rest)):
        return answer
    if request is None or reading is None:
        return None
    described = merge_request(request, said(reading, text).query)
    counts = find_ordinals(reading.query.referent.qualifiers) if reading.query.referent else ()
    # "No, the second one" is no word about a place that is offered at the first.
    in_list = question is not None and (talk.state.lists or not counts)
    if question is not None and in_list and (fitting := find_fitting(reading, question.candidates, talk.scene)):
        return talk.narrow(fitting, described)
    described = merge_request(request, said(widen(reading, talk.scene), text).query)
    rejected = frozenset[str]()
    if {"no", "other"} & {*reply.kinds} and request.chosen is not None and question is None:
        rejected = frozenset({request.chosen.item.id})
    found = resolve(described.query, without(talk.scene, rejected))
    if "other" not in reply.kinds and (known := talk.spoken_of(found.candidates)):
        return talk.choose(known, described)
    if found.status == "ok" and found.candidates:
        return talk.choose(found.candidates[0], described)
    if found.status == "ambiguous":
        offered = {one.item.id for one in talk.state.offered}
        before = [one for one in found.candidates if one.item.id in offered]
        # Of a red car and a red van, "the car" is the red one.
        return talk.narrow(before or found.candidates, described)
    if question is not None or (turn is not None and talk.state.question is not None):
        return None  # a question stays open if what is not plain fits nothing
    return talk.take(talk.state.with_request(described))


def _with_own_words(told: Reading, reading: Reading | None) -> Reading:
    """Return the description of the network with the qualifiers of the grammar that the network does not know."""
    said, named = told.query.referent, reading.query.referent if reading is not None else None
    if said is None or named is None:
        return told
    more = tuple(one for one in unlearnt_qualifiers(named) if one not in said.qualifiers)
    return reading_of(replace(said, qualifiers=(*said.qualifiers, *more)))


def _is_simple(reading: Reading) -> bool:
    """Return whether a description has no neighbour, and nothing that is not meant."""
    return not (reading.query.secondary or evidence_of(reading).contrary)


def _is_neighbour(talk: Conversation, reading: Reading, told: Reading) -> bool:
    """Return whether the grammar takes the neighbour of a person for the one meant: "the lad past the black car"."""
    meant, own, spoken_of = told.query.referent, reading.query.referent, talk.antecedent
    persons = spoken_of is not None and spoken_of.noun == "person" and meant is not None and meant.noun == "person"
    return persons and own is not None and own.noun != "person"


def _likeliest(talk: Conversation, turn: Turn) -> Reading | None:
    """Return the likeliest description that a vehicle of the scene fits, else the likeliest; None without one."""
    found = [reading_of(one) for one in turn.descriptions(talk.antecedent)]
    here = (one for one in found if resolve(widen(one, talk.scene).query, talk.scene).status != "not_found")
    return next(here, found[0] if found else None)


def described_by(turn: Turn | None, antecedent: Referent | None) -> Reading | None:
    """Return the partial reading of the vehicle that the reader of turns finds described; None without one."""
    referent = turn.described(antecedent) if turn is not None else None
    return None if referent is None else reading_of(referent)


def unknown_one(described: Reading, words: str) -> Reading | None:
    """Return what "who's that in orange?" and "what's that big thing?" describe; None for other questions."""
    referent = described.query.referent
    found = _WHO_OR_WHAT.match(words)
    if referent is None or found is None or not (referent.colour or referent.qualifiers):
        return None
    noun = "person" if found["who"] else "vehicle"
    return reading_of(Referent(noun, noun, referent.colour, referent.qualifiers))


def refuse_described(talk: Conversation, text: str, words: str) -> Answer | None:
    """Narrow the candidates of the open question by "not the near one"; None for other words, or if none is left."""
    question, request = talk.state.question, talk.state.request
    if question is None or request is None or not words.startswith("not "):
        return None
    reading = read_description(words.removeprefix("not "), talk.antecedent, talk.readings)
    refused = find_fitting(reading, question.candidates, talk.scene) if reading is not None else []
    ids = {one.item.id for one in refused}
    left = [one for one in question.candidates if one.item.id not in ids] if refused else []
    return talk.narrow(left, replace(request, reading=said(request.reading, text))) if left else None


def _modify(talk: Conversation, reading: Reading, request: Request) -> Answer:
    """Plan the last command with another relation, side or distance; a move to the other side is turned."""
    if turned := _turned(request, reading):
        return talk.take(talk.state.with_request(turned))
    changed = merge_request(request, reading.query)
    query, chosen = changed.query, changed.chosen
    if names_pronoun(reading):
        # "Behind it, not in front": the other place is that of the same vehicle.
        query = replace(query, excluded=tuple(one for one in query.excluded if one.relation is None))
        chosen = talk.meant or chosen
    changed = replace(changed, chosen=chosen, reading=reading.with_query(query))
    return _take_changed(talk, changed, reading.query)


def _turned(request: Request, reading: Reading) -> Request | None:
    """Return a step whose last move, to a side, is to the other one that a reading names; None for other readings."""
    query, last = reading.query, request.shifts[-1:]
    direction = _SIDEWAYS.get(query.goal_side or query.direction or "")
    placed = query.relation != "none" or query.referent is not None or query.distance_m is not None
    if direction is None or placed or not last or last[0].direction not in _SIDEWAYS.values():
        return None
    moved = (*request.shifts[:-1], replace(last[0], direction=direction))
    return replace(request, shifts=moved, reading=said(request.reading, query.command))


def _take_changed(talk: Conversation, changed: Request, said: Query) -> Answer:
    """Plan a changed step; of several vehicles that a plain noun phrase fits, "the van" is the one spoken of."""
    if changed.chosen is None and talk.state.question is None:
        found = resolve(changed.query, talk.scene)
        again = talk.in_focus(said) if found.status == "ambiguous" else None
        changed = replace(changed, chosen=again)
    return talk.take(talk.state.with_request(changed))


def replace_step(talk: Conversation, requests: Sequence[Request]) -> Answer | None:
    """Put a command in the place of the step of the plan that has the same action; None if there is none."""
    plan = talk.state.plan
    same = [i for i, step in enumerate(plan) if step.query.action == requests[0].query.action]
    if len(requests) != 1 or len(plan) < 2 or not same:
        return None
    return talk.take((*plan[: same[-1]], requests[0], *plan[same[-1] + 1 :]))


def drop_step_at(talk: Conversation, text: str, named: Referent) -> Answer | None:
    """Drop the only step at a vehicle: "skip the truck"; None if the plan has no such step, or no other.

    None too if several vehicles are named, of which one is kept: "forget the van, just the red car".
    """
    plan = talk.state.plan
    if sum(token.category is WordCategory.NOUN for token in talk.read(text).tokens) > 1:
        return None
    found = resolve(Query("", referent=named), talk.scene)
    ids = {one.item.id for one in found.candidates} if found.status != "not_found" else set[str]()
    left = tuple(step for step in plan if not (step.chosen is not None and step.chosen.item.id in ids))
    if not left or len(left) != len(plan) - 1:
        return None
    return talk.take_steps(text, left)


def drop_step_number(talk: Conversation, text: str, number: int | None) -> Answer | None:
    """Drop a step by its number, -1 for the last: "leave the second part out"; None without such a step."""
    plan = talk.state.plan
    at = len(plan) if number == -1 else number or 0
    if len(plan) < 2 or not 1 <= at <= len(plan):
        return None
    left = (*plan[: at - 1], *plan[at:])
    return talk.take_steps(text, left)


def drop_steps(talk: Conversation, text: str, action: Action) -> Answer:
    """Drop the steps of an action: "never mind the overtaking"."""
    plan = talk.state.plan
    left = tuple(step for step in plan if step.query.action != action)
    if not left:
        return cancel(talk, text)
    if len(left) == len(plan):
        return inform(talk, text, f"the plan has no step '{action}': it stays as it is")
    return talk.take_steps(text, left)


def names_place_only(talk: Conversation, words: str) -> bool:
    """Return whether words name another place at a vehicle that they do not describe, while a goal is in force."""
    state = talk.state
    if state.goal is None or state.question is not None or state.request is None:
        return False
    placed = complete(words, state.request.query, talk.antecedent, talk.readings)
    return placed is not None and names_pronoun(placed)
